// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/errors.hpp"

namespace orbslam::bindings {

/// In objects that serve one thread at a time. The interpreter's lock guards it.
class OneThread {
 public:
  /// While it lives, another one of the same object throws StateError. To be made before arrays
  /// are converted: NumPy may let other threads run meanwhile.
  class Use {
   public:
    Use(OneThread& object, const char* refusal) : object_(object) {
      if (object_.busy_) throw StateError(refusal);
      object_.busy_ = true;
    }
    ~Use() { object_.busy_ = false; }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    OneThread& object_;
  };

 private:
  bool busy_ = false;
};

}  // namespace orbslam::bindings
