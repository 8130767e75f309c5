#!/bin/sh
# A batch of Carillon's jobs: task N of the array takes folder N of the list. carillon writes this script from deploy/slurm/job.sh.
@PROLOGUE@
set -- @FOLDERS@
shift "${SLURM_ARRAY_TASK_ID:-0}"
# exec: Slurm's signals reach the attempt itself. It saves, has Slurm queue the job again, and ends.
exec @PROGRAM@ attempt @WORK@/"$1" --engine slurm --ranks @RANKS@ --memory-gb @MEMORY_GB@ --launcher @LAUNCHER@@OPTIONS@
