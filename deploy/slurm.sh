#!/bin/sh
# A qualification and a campaign as an array job of Slurm: each task does the part that its number says.
#
#   CAMPAIGN=campaign.toml sbatch --wait deploy/slurm.sh && sh deploy/slurm-merge.sh
#
# QUALIFY holds further arguments of `qualify`. What the tasks write is joined by deploy/slurm-merge.sh.
#SBATCH --job-name=vda5050-tck
#SBATCH --array=1-8
#SBATCH --ntasks=1
#SBATCH --output=part-%a.txt
set -u

# 1 does not conform, 3 is undecided and 4 has nothing to do: these are results. Anything else broke.
settled() {
  case $1 in
  0 | 1 | 3 | 4) ;;
  *) exit "$1" ;;
  esac
}

vda5050-tck qualify --out "qualification/$SLURM_ARRAY_TASK_ID" ${QUALIFY:-}
settled $?
vda5050-tck campaign "$CAMPAIGN" --out "campaign/$SLURM_ARRAY_TASK_ID"
settled $?
