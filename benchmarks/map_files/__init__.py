# SPDX-License-Identifier: BSD-3-Clause
"""Map files: killed while they are written, spoilt, measured, used."""
