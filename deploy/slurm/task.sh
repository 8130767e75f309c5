#!/bin/sh
# A packed array of Carillon's jobs: task N runs the jobs of STORE/slurm/BATCH/N.jobs, as many at a time as it has cores for. carillon writes
# this script from deploy/slurm/task.sh.
@PROLOGUE@
# exec: Slurm's signals reach the runner itself. It has its jobs saved, has Slurm queue the task again, and ends.
exec @PROGRAM@ task @STORE@ @BATCH@ "${SLURM_ARRAY_TASK_ID:-0}"@OPTIONS@
