# SPDX-License-Identifier: BSD-3-Clause
"""Visual words: find, read, convert and train vocabularies."""

from orbslam2py.vocabulary.vocabulary import (
    ENVIRONMENT_VARIABLE,
    VocabularyFormat,
    VocabularyInfo,
    convert_vocabulary,
    default_vocabulary_path,
    load_vocabulary,
    read_training_images,
    save_vocabulary,
    train_vocabulary,
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
