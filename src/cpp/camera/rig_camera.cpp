// SPDX-License-Identifier: BSD-3-Clause
// Camera: the methods for rigs of several cameras.
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/errors.hpp"
#include "camera/camera.hpp"
#include "camera/rig_plane.hpp"

namespace orbslam {

std::vector<Camera::Slot> Camera::slots_of(const CameraOptions& options) {
  std::vector<Slot> slots;
  if (options.members.empty()) return slots;
  const std::vector<PlaneColumns> columns = plane_columns(options.members);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const RigMember& member = options.members[i];
    Slot slot;
    slot.camera = member.camera.get();
    slot.R_bc = member.T_bc.rotation_matrix();
    slot.R_cb = slot.R_bc.transpose();
    slot.centre = member.T_bc.translation();
    slot.t_cb = -(slot.R_cb * slot.centre);
    slot.column = columns[i].zero;
    slot.end = columns[i].last + 0.5 * kRigGap;
    const double own = member.camera->bf();
    slot.scale = own > 0 && options.bf > 0 ? options.bf / own : 1;
    slot.active = member.active;
    slots.push_back(slot);
  }
  return slots;
}

Camera Camera::with_active(const std::vector<bool>& active) const {
  if (active.size() != options_.members.size()) {
    throw StateError("with_active: one entry for each camera of the rig");
  }
  CameraOptions options;
  options.members = options_.members;
  for (std::size_t i = 0; i < active.size(); ++i) options.members[i].active = active[i];
  return Camera(options);
}

bool Camera::project_into(std::size_t camera, const Eigen::Vector3d& p_b,
                          Eigen::Vector2d& uv) const {
  if (!rig_) return project(p_b, uv);
  const Slot& at = slots_[camera];
  Eigen::Vector2d pixel;
  if (!at.camera->project(at.R_cb * p_b + at.t_cb, pixel)) return false;
  uv = {pixel.x() + at.column, pixel.y()};
  return true;
}

const Camera::Slot* Camera::looking_at(const Eigen::Vector3d& p_b, Eigen::Vector3d& p_c,
                                       Eigen::Vector2d& uv) const {
  const Slot* best = nullptr;
  double most_off = std::numeric_limits<double>::infinity();
  for (const Slot& at : slots_) {
    if (!at.active) continue;
    const Eigen::Vector3d p = at.R_cb * p_b + at.t_cb;
    Eigen::Vector2d pixel;
    if (!at.camera->project(p, pixel)) continue;
    const ImageBounds& bounds = at.camera->bounds();
    if (!bounds.contains(pixel.x(), pixel.y())) continue;
    const double width = bounds.max_x - bounds.min_x, height = bounds.max_y - bounds.min_y;
    const double off = std::max(std::abs((pixel.x() - bounds.min_x) / width - 0.5),
                                std::abs((pixel.y() - bounds.min_y) / height - 0.5));
    if (!(off < most_off)) continue;
    most_off = off;
    best = &at;
    p_c = p;
    uv = {pixel.x() + at.column, pixel.y()};
  }
  return best;
}

bool Camera::project_wide(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv,
                          double& disparity_of_it) const {
  if (!rig_) {
    if (!project_wide(p_c, uv)) return false;
    disparity_of_it = disparity(p_c);
    return true;
  }
  Eigen::Vector3d in_camera;
  const Slot* at = looking_at(p_c, in_camera, uv);
  if (at == nullptr) return false;
  disparity_of_it = at->camera->has_baseline() ? at->camera->disparity(in_camera) : 0;
  return true;
}

bool Camera::error_in_rig(const Eigen::Vector3d& p_b, double u, double v,
                          Eigen::Vector2d& error) const {
  const Slot& at = slot(u);
  return at.camera->error(at.R_cb * p_b + at.t_cb, u - at.column, v, error);
}

Eigen::Vector3d Camera::unproject_in_rig(double u, double v, double depth) const {
  const Slot& at = slot(u);
  return at.R_bc * at.camera->unproject(u - at.column, v, depth) + at.centre;
}

Sight Camera::sight_of_rig(double u, double v) const {
  const Slot& at = slot(u);
  const Eigen::Matrix3d own = at.scale * at.camera->sight_of_one(u - at.column, v);
  Sight sight;
  sight.leftCols<3>() = own * at.R_cb;
  sight.col(3) = own * at.t_cb;
  return sight;
}

}  // namespace orbslam
