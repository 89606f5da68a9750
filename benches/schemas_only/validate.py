"""Validates a recording of `simulate site` with the Python package `jsonschema`: schemas only, nothing else is judged.

    python3 validate.py site.jsonl
"""

import json
import pathlib
import sys
import time

from jsonschema import Draft202012Validator

TOPICS = ["connection", "factsheet", "instantActions", "order", "state", "visualization"]
FOLDER = pathlib.Path(__file__).resolve().parents[2] / "schemas"
SCHEMAS = {
    (version, topic): Draft202012Validator(json.loads((FOLDER / version / f"{topic}.schema.json").read_text()))
    for version in ["2.0", "2.1"]
    for topic in TOPICS
}

begun = time.monotonic()
messages = invalid = 0
with open(sys.argv[1], encoding="utf-8") as recording:
    for line in recording:
        record = json.loads(line)
        messages += 1
        try:
            message = json.loads(record["payload"])
            version = "2.0" if str(message.get("version")).startswith("2.0") else "2.1"
            valid = SCHEMAS[version, record["topic"].rpartition("/")[2]].is_valid(message)
        except (ValueError, AttributeError):
            valid = False
        invalid += not valid
seconds = time.monotonic() - begun
print(f"jsonschema: {messages} messages, {invalid} invalid, {seconds:.1f} s, {messages / seconds:.0f} a second")
