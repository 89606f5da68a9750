// Many AgvControllers of the npm package vda-5050-lib in one process, each with a state and a visualization a second, as
// `simulate agv --count N --state-interval 1` has them. It takes the package that is installed for the foreign vehicle.
//
// node benches/npm_fleet/fleet.mjs mqtt://127.0.0.1:1883 200

import { createRequire } from "node:module";

const require = createRequire(new URL("../../fixtures/devices/vda-5050-lib-agv/package.json", import.meta.url));
const { AgvController, VirtualAgvAdapter } = require("vda-5050-lib");

const [broker, count] = process.argv.slice(2);
for (let number = 1; number <= Number(count); number += 1) {
  const controller = new AgvController(
    { manufacturer: "npm", serialNumber: `fleet-${number}` },
    { interfaceName: "uagv", transport: { brokerUrl: broker }, vdaVersion: "2.0.0" },
    { agvAdapterType: VirtualAgvAdapter, publishStateInterval: 1000, publishVisualizationInterval: 1000 },
    { initialPosition: { mapId: "floor", x: 0, y: 0, theta: 0, lastNodeId: "n1" }, tickRate: 1 },
  );
  await controller.start();
}
