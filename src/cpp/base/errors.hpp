// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>

namespace orbslam {

/// Base of everything the library throws on purpose. The bindings map each type to the Python
/// class of the same name. Messages name the thing that is wrong and what to do about it.
class OrbSlamError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A setting is missing, misspelt or out of range.
class SettingsError : public OrbSlamError {
 public:
  using OrbSlamError::OrbSlamError;
};

/// An image is empty, of the wrong type or of an unexpected size.
class ImageError : public OrbSlamError {
 public:
  using OrbSlamError::OrbSlamError;
};

/// A vocabulary file cannot be read or is inconsistent.
class VocabularyError : public OrbSlamError {
 public:
  using OrbSlamError::OrbSlamError;
};

/// A map file cannot be read or is inconsistent.
class MapFileError : public OrbSlamError {
 public:
  using OrbSlamError::OrbSlamError;
};

/// A call that is not possible in the present state (wrong sensor, dead id, concurrent call).
class StateError : public OrbSlamError {
 public:
  using OrbSlamError::OrbSlamError;
};

}  // namespace orbslam
