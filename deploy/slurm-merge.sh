#!/bin/sh
# Joins what the tasks of deploy/slurm.sh have written: the qualification, and each device and suite of the campaign.
# The exit code is the worst of all.
set -u
worst=0
joined() {
  if [ "$1" -gt "$worst" ]; then worst=$1; fi
}

vda5050-tck report --merge qualification --out whole/qualification
joined $?
for entry in campaign/1/*/*/; do
  entry=${entry#campaign/1/}
  entry=${entry%/}
  set --
  for part in campaign/*/"$entry"/reports; do
    # A part of which there was nothing to do has no report.
    if [ -d "$part" ]; then set -- "$@" "$part"; fi
  done
  vda5050-tck report --merge "$@" --out "whole/$entry"
  joined $?
done
exit "$worst"
