# SPDX-License-Identifier: BSD-3-Clause
"""Visual words: find, read, convert and train vocabularies."""

from orbslam2py.vocabulary.files import VocabularyFormat
from orbslam2py.vocabulary.training import read_training_images, train_vocabulary
from orbslam2py.vocabulary.vocabulary import (
    ENVIRONMENT_VARIABLE,
    VocabularyInfo,
    convert_vocabulary,
    default_vocabulary_path,
    load_vocabulary,
    save_vocabulary,
    vocabulary_info,
)

__all__ = [
    "ENVIRONMENT_VARIABLE",
    "VocabularyFormat",
    "VocabularyInfo",
    "convert_vocabulary",
    "default_vocabulary_path",
    "load_vocabulary",
    "read_training_images",
    "save_vocabulary",
    "train_vocabulary",
    "vocabulary_info",
]
