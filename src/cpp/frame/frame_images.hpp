// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "features/image_pyramid.hpp"

namespace orbslam {

/// The image pyramids of a frame, while patches are still compared in them. A frame is shared
/// between threads; the images may be released at any time, but a pointer that was handed out keeps
/// them alive.
class FrameImages {
 public:
  struct Pyramids {
    ImagePyramid left;
    ImagePyramid right;  ///< without levels when there is no right image
  };

  explicit FrameImages(Pyramids pyramids)
      : pyramids_(std::make_shared<const Pyramids>(std::move(pyramids))) {}

  /// Null once they are released.
  std::shared_ptr<const Pyramids> get() const {
    const std::lock_guard lock(mutex_);
    return pyramids_;
  }
  void release() {
    const std::lock_guard lock(mutex_);
    pyramids_.reset();
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Pyramids> pyramids_;
};

}  // namespace orbslam
