# SPDX-License-Identifier: BSD-3-Clause
"""This version beside another one, on one machine in one run."""
