# SPDX-License-Identifier: BSD-3-Clause
"""Cropping, transforming and combining maps."""
