// SPDX-License-Identifier: BSD-3-Clause
#include "camera/rig_plane.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

void check(const std::vector<RigMember>& members) {
  if (members.size() < 2 || members.size() > kMostCameras) {
    throw SettingsError("a rig has 2 to " + std::to_string(kMostCameras) + " cameras, got " +
                        std::to_string(members.size()));
  }
  for (const RigMember& member : members) {
    if (!member.camera || member.camera->is_rig()) {
      throw SettingsError("every camera of a rig must be a single camera");
    }
    if (!member.T_bc.translation().allFinite() || !member.T_bc.rotation().coeffs().allFinite()) {
      throw SettingsError("the extrinsics of a rig's cameras must be finite");
    }
  }
}

}  // namespace

std::vector<PlaneColumns> plane_columns(const std::vector<RigMember>& members) {
  std::vector<PlaneColumns> columns;
  double next = 0;
  for (const RigMember& member : members) {
    const ImageBounds& bounds = member.camera->bounds();
    const double width = member.camera->image_size().width;
    const double before = std::floor(std::min(0.0, static_cast<double>(bounds.min_x)));
    const double after = std::ceil(std::max(width, static_cast<double>(bounds.max_x)));
    columns.push_back({next - before, next, next - before + after});
    next = columns.back().last + Camera::kRigGap;
  }
  return columns;
}

CameraOptions checked_rig(const CameraOptions& options) {
  check(options.members);
  const auto& members = options.members;
  const auto is_active = [](const RigMember& member) { return member.active; };
  auto leading = std::find_if(members.begin(), members.end(), [](const RigMember& member) {
    return member.active && member.camera->has_baseline();
  });
  if (leading == members.end()) leading = std::find_if(members.begin(), members.end(), is_active);
  if (leading == members.end()) throw SettingsError("no camera of the rig is active");
  CameraOptions full = leading->camera->options();
  full.distortion = {};
  full.model.reset();
  full.right_centre.setZero();
  full.members = members;
  full.image_size.width = static_cast<int>(plane_columns(members).back().last);
  for (const RigMember& member : members) {
    full.image_size.height = std::max(full.image_size.height, member.camera->image_size().height);
  }
  return full;
}

ImageBounds bounds_of_rig(const CameraOptions& options) {
  ImageBounds bounds{0, static_cast<float>(options.image_size.width), 0,
                     static_cast<float>(options.image_size.height)};
  for (const RigMember& member : options.members) {
    bounds.min_y = std::min(bounds.min_y, member.camera->bounds().min_y);
    bounds.max_y = std::max(bounds.max_y, member.camera->bounds().max_y);
  }
  return bounds;
}

bool any_distorts(const std::vector<RigMember>& members) {
  return std::any_of(members.begin(), members.end(),
                     [](const RigMember& member) { return member.camera->distorts(); });
}

double deepest_close(const std::vector<RigMember>& members) {
  double deepest = 0;
  for (const RigMember& member : members) {
    if (member.camera->has_baseline()) deepest = std::max(deepest, member.camera->close_depth());
  }
  return deepest > 0 ? deepest : std::numeric_limits<double>::infinity();
}

}  // namespace orbslam
