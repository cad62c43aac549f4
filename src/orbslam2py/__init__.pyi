# SPDX-License-Identifier: BSD-3-Clause
# The public names of the package, and where they are. `__init__.py` reads this file.

from ._version import __version__ as __version__
from .datasets import open_sequence as open_sequence
from .errors import DatasetError as DatasetError
from .errors import ImageError as ImageError
from .errors import MapFileError as MapFileError
from .errors import OrbSlamError as OrbSlamError
from .errors import SettingsError as SettingsError
from .errors import StateError as StateError
from .errors import VocabularyError as VocabularyError
from .errors import WorkerError as WorkerError
from .maps import MapSnapshot as MapSnapshot
from .maps import export_colmap as export_colmap
from .maps import export_g2o as export_g2o
from .maps import export_nerfstudio as export_nerfstudio
from .maps import export_points as export_points
from .maps import export_trajectory as export_trajectory
from .runs import run_sequence as run_sequence
from .settings import Sensor as Sensor
from .settings import Settings as Settings
from .slam.events import Callbacks as Callbacks
from .slam.events import KeyframeAdded as KeyframeAdded
from .slam.events import LoopClosed as LoopClosed
from .slam.events import MapChangeCause as MapChangeCause
from .slam.events import MapChanged as MapChanged
from .slam.events import Relocalized as Relocalized
from .slam.events import TrackingLost as TrackingLost
from .slam.full_bundle_adjustment import FullAdjustmentRecord as FullAdjustmentRecord
from .slam.records import FrameFeatures as FrameFeatures
from .slam.records import Reason as Reason
from .slam.records import TrackingRecord as TrackingRecord
from .slam.records import TrackingState as TrackingState
from .slam.system import System as System
from .trajectory import Trajectory as Trajectory
from .vocabulary import load_vocabulary as load_vocabulary
