# SPDX-License-Identifier: BSD-3-Clause
"""Whether wrong calibrations are told, and right ones are not."""
