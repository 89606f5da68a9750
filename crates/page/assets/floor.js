// The course as a picture, and a table that says what it shows.
"use strict";
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const SIZE = 1000;
  const BORDER = 60;
  // Beyond this the names of nodes would cover each other.
  const NAMED = 80;
  const svg = document.getElementById("floor");
  let floor = null;
  let vehicle = null;
  let fleet = [];
  let findings = [];
  let place = null;

  const draw = (kind, attributes, text) => {
    const element = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    if (text !== undefined) element.textContent = text;
    svg.append(element);
    return element;
  };
  const points = (line) => line.map(([x, y]) => place(x, y).map((one) => one.toFixed(1)).join(",")).join(" ");

  const isSomewhere = (one) => one && Number.isFinite(one.x) && Number.isFinite(one.y);

  function arrow(one) {
    const [x, y] = place(one.x, one.y);
    const turned = ((-(one.theta || 0) * 180) / Math.PI).toFixed(1);
    draw("path", { d: "M 16 0 L -10 -10 L -5 0 L -10 10 Z", transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${turned})`, class: "vehicle" });
  }

  // Findings at one place share a mark, which the worst of them gives its shape and the table explains by its number.
  function marks() {
    const all = new Map();
    for (const { requirement, verdict, message, spot } of findings) {
      const key = [spot.map, spot.x.toFixed(2), spot.y.toFixed(2)].join(" ");
      const mark = all.get(key) || { spot, verdict, told: [] };
      mark.told.push(`${requirement} ${verdict}: ${message}`);
      all.set(key, mark);
    }
    return [...all.values()];
  }

  function drawMark({ spot, verdict }, number) {
    const [x, y] = place(spot.x, spot.y);
    const shape = verdict === "fail" ? "M -11 -11 L 11 11 M 11 -11 L -11 11" : "M 0 -12 L 12 10 L -12 10 Z";
    draw("path", { d: shape, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})`, class: `mark ${verdict}` });
    draw("text", { x: x + 14, y: y + 22, class: "mark" }, String(number));
  }

  // The vehicles of a watch, each map a picture of its own beside the others; nobody has said how their floors look.
  function fleetPicture() {
    const known = fleet.filter(isSomewhere);
    document.getElementById("course").hidden = known.length === 0;
    if (known.length === 0) return;
    svg.replaceChildren();
    const maps = [...new Set(known.map((one) => one.map || ""))].sort();
    let top = 0;
    for (const map of maps) {
      const here = known.filter((one) => (one.map || "") === map);
      const height = scale(here);
      const flat = place;
      const shift = top;
      place = (x, y) => [flat(x, y)[0], flat(x, y)[1] + shift];
      draw("text", { x: 8, y: top + 20 }, map || "no map");
      for (const one of here) {
        arrow(one);
        const [x, y] = place(one.x, one.y);
        if (known.length <= NAMED) draw("text", { x: x + 14, y: y - 10 }, one.name);
      }
      top += height;
    }
    svg.setAttribute("viewBox", `0 0 ${SIZE + 2 * BORDER} ${top.toFixed(0)}`);
  }

  function scale(nodes) {
    const places = nodes.map(({ x, y }) => [x, y]);
    if (isSomewhere(vehicle)) places.push([vehicle.x, vehicle.y]);
    for (const { spot } of findings) if (nodes.some((node) => node.map === spot.map)) places.push([spot.x, spot.y]);
    const xs = places.map(([x]) => x);
    const ys = places.map(([, y]) => y);
    const left = Math.min(...xs);
    const top = Math.max(...ys);
    const width = Math.max(Math.max(...xs) - left, 0.001);
    const height = Math.max(top - Math.min(...ys), 0.001);
    const factor = Math.min(SIZE / width, SIZE / 2 / height);
    svg.setAttribute("viewBox", `0 0 ${(width * factor + 2 * BORDER).toFixed(0)} ${(height * factor + 2 * BORDER).toFixed(0)}`);
    place = (x, y) => [BORDER + (x - left) * factor, BORDER + (top - y) * factor];
    return height * factor + 2 * BORDER;
  }

  function row(name, value) {
    const line = document.createElement("tr");
    const head = document.createElement("th");
    head.scope = "row";
    head.textContent = name;
    const cell = document.createElement("td");
    cell.textContent = value;
    line.append(head, cell);
    return line;
  }

  function table() {
    const known = vehicle || { nodes: [], edges: [] };
    const ids = (released) => known.nodes.filter((node) => node.released === released).map((node) => node.id);
    const number = (value) => (Number.isFinite(value) ? value.toFixed(2) : "?");
    const where = Number.isFinite(known.x) ? `x ${number(known.x)} m, y ${number(known.y)} m, heading ${number(known.theta)} rad` : "not known";
    document.getElementById("vehicle-facts").replaceChildren(
      row("Map", known.map || "not known"),
      row("Vehicle", where),
      row("Drives", known.driving === true ? "yes" : known.driving === false ? "no" : "not known"),
      row("Last node", known.lastNode || "none"),
      row("Order", known.order || "none"),
      row("Base ahead", ids(true).join(", ") || "none"),
      row("Horizon ahead", ids(false).join(", ") || "none"),
      row("Floor", `${floor.nodes.length} nodes, ${floor.edges.length} edges`),
      ...marks().map(({ spot, told }, at) => row(`Mark ${at + 1}`, `x ${number(spot.x)} m, y ${number(spot.y)} m on ${spot.map || "no map"}: ${told.join("; ")}`)),
    );
  }

  function picture() {
    if (floor === null || floor.nodes.length === 0) return;
    document.getElementById("course").hidden = false;
    const maps = [...new Set(floor.nodes.map((node) => node.map))];
    const map = vehicle && maps.includes(vehicle.map) ? vehicle.map : maps[0];
    const nodes = floor.nodes.filter((node) => node.map === map);
    const here = new Map(nodes.map((node) => [node.id, node]));
    scale(nodes);
    svg.replaceChildren();
    const released = new Map((vehicle ? vehicle.edges : []).map((edge) => [edge.id, edge.released]));
    const on = floor.edges.filter((edge) => here.has(edge.start) && here.has(edge.end));
    for (const edge of on) draw("polyline", { points: points(edge.line), class: "edge" });
    for (const edge of on.filter((one) => released.has(one.id)))
      draw("polyline", { points: points(edge.line), class: released.get(edge.id) ? "base" : "horizon" });
    if (vehicle && vehicle.trail.length > 1) draw("polyline", { points: points(vehicle.trail), class: "trail" });
    for (const node of nodes) {
      const [x, y] = place(node.x, node.y);
      if (node.station) draw("rect", { x: x - 7, y: y - 7, width: 14, height: 14, class: "node" });
      else draw("circle", { cx: x, cy: y, r: 5, class: "node" });
      if (nodes.length <= NAMED) draw("text", { x: x + 8, y: y - 8 }, node.id);
    }
    if (isSomewhere(vehicle)) arrow(vehicle);
    marks().forEach((mark, at) => {
      if (mark.spot.map === map) drawMark(mark, at + 1);
    });
    table();
  }

  window.floorPicture = {
    floor(told) {
      floor = told;
      picture();
    },
    fleet(told) {
      fleet = told;
      if (floor === null) fleetPicture();
    },
    findings(told) {
      findings = told;
      picture();
    },
    vehicle(told) {
      vehicle = told;
      picture();
    },
  };
})();
