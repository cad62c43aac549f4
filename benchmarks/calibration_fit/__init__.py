# SPDX-License-Identifier: BSD-3-Clause
"""Whether wrong calibrations are reported, and right ones are not."""
