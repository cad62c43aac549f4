#!/bin/bash
# A batch of orbslam2py on SLURM: one scheduler, and workers on all nodes of the job.
#
#   sbatch examples/cluster/slurm.sh jobs.yaml /shared/night
#
# Sequences and output must be on a disk that all nodes see. To go on after the time is over, submit
# it again: what was finished is not run again.
#SBATCH --job-name=orbslam2py
#SBATCH --nodes=4
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=16
#SBATCH --mem-per-cpu=2G
#SBATCH --time=08:00:00
set -euo pipefail

jobs=$1
output=$2
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 # one run a core: no threads inside of libraries
address_file=$output.scheduler.json
rm -f "$address_file"

dask scheduler --interface "${INTERFACE:-ib0}" --port 0 --no-dashboard --scheduler-file "$address_file" &
until [ -s "$address_file" ]; do sleep 1; done
srun --kill-on-bad-exit=0 dask worker --scheduler-file "$address_file" --no-dashboard \
    --nworkers "$SLURM_CPUS_PER_TASK" --nthreads 1 --local-directory "${TMPDIR:-/tmp}" &

address=$(python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["address"])' "$address_file")
if [ -f "$output/batch.json" ]; then resume=--resume; else resume=; fi
orbslam2py batch "$jobs" --output "$output" --scheduler "$address" $resume
