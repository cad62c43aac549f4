# SPDX-License-Identifier: BSD-3-Clause
"""``python -m orbslam2py``."""

from orbslam2py.cli import main

if __name__ == "__main__":
    main()
