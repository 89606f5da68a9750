// Validates a recording of `simulate site` with Ajv: schemas only, nothing else is judged.
//
//   node validate.mjs site.jsonl

import { createReadStream, readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import Ajv from "ajv/dist/2020.js";

const TOPICS = ["connection", "factsheet", "instantActions", "order", "state", "visualization"];
const ajv = new Ajv({ strict: false, validateFormats: false });
const schemas = {};
for (const version of ["2.0", "2.1"]) {
  for (const topic of TOPICS) {
    const file = fileURLToPath(new URL(`../../schemas/${version}/${topic}.schema.json`, import.meta.url));
    schemas[`${version} ${topic}`] = ajv.compile(JSON.parse(readFileSync(file, "utf8")));
  }
}

const begun = performance.now();
let messages = 0;
let invalid = 0;
for await (const line of createInterface({ input: createReadStream(process.argv[2]), crlfDelay: Infinity })) {
  const { topic, payload } = JSON.parse(line);
  messages += 1;
  try {
    const message = JSON.parse(payload);
    const version = String(message.version).startsWith("2.0") ? "2.0" : "2.1";
    const valid = schemas[`${version} ${topic.slice(topic.lastIndexOf("/") + 1)}`];
    if (!valid(message)) invalid += 1;
  } catch {
    invalid += 1;
  }
}
const seconds = (performance.now() - begun) / 1000;
console.log(`Ajv: ${messages} messages, ${invalid} invalid, ${seconds.toFixed(1)} s, ${Math.round(messages / seconds)} a second`);
