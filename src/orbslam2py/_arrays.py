# SPDX-License-Identifier: BSD-3-Clause
"""Names of the array types that signatures share.

They tell the type of the elements; shapes, units and frames are told where an array is described.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ByteArray = NDArray[np.uint8]
