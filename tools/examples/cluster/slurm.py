"""Runs a campaign on the nodes of a SLURM cluster: python slurm.py WORKERS brickpilot campaign FILE --out FOLDER

It asks SLURM for WORKERS jobs of one core, and runs the command with the address of their scheduler. The jobs end with
it. Run it on the login node, in the environment that the nodes see too: the workers have to have the same brickpilot.
"""

from __future__ import annotations

import subprocess
import sys
from typing import Any

from dask_jobqueue import SLURMCluster

JOB: dict[str, Any] = {
    "cores": 1,
    "processes": 1,
    "memory": "2GB",
    "walltime": "02:00:00",
    "job_extra_directives": ["--requeue"],
    "worker_extra_args": ["--no-dashboard"],
    "local_directory": "/tmp",
    "log_directory": "logs",
    "scheduler_options": {"dashboard": False},
}
"""One worker, as SLURM is asked for it. Add what your cluster needs: queue="NAME", account="NAME", interface="ib0"."""


def main(workers: int, command: list[str]) -> int:
    """Returns the exit status of the command."""
    with SLURMCluster(**JOB) as cluster:
        cluster.scale(jobs=workers)
        return subprocess.run([*command, "--scheduler", cluster.scheduler_address], check=False).returncode


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
