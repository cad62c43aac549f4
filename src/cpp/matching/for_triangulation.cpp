// SPDX-License-Identifier: BSD-3-Clause
#include "matching/for_triangulation.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <optional>

#include "geometry/point_pairs.hpp"
#include "geometry/triangulation.hpp"
#include "map/scene_depth.hpp"
#include "matching/by_projection.hpp"
#include "matching/common_nodes.hpp"
#include "matching/pair_triangulation.hpp"
#include "matching/pose_guard.hpp"

namespace orbslam {
namespace {

using FeaturePairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

constexpr double kEpipolarGate = 3.84;           // chi-square, 95 %, 1 degree of freedom
constexpr double kEpipoleExclusion = 100.0;      // pixels^2 at scale 1
constexpr double kLeastBaselinePerDepth = 0.01;  // of a single camera

// A keyframe as the search sees it, copied under the lock.
struct FreeFeatures {
  std::shared_ptr<const Frame> frame;
  Pose T_cw;
  std::vector<std::uint8_t> occupied;  // per keypoint: it has a point
};

std::optional<FreeFeatures> gather(const Map& map, KeyFrameId id) {
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe) return std::nullopt;
  FreeFeatures view{keyframe->frame, keyframe->T_cw, {}};
  view.occupied.resize(keyframe->map_points.size());
  for (std::size_t i = 0; i < view.occupied.size(); ++i) {
    view.occupied[i] = map.find(keyframe->map_points[i]) != nullptr;
  }
  return view;
}

// Epipolar constraint between features of two cameras with a known relative pose.
class EpipolarGeometry {
 public:
  EpipolarGeometry(const FreeFeatures& a, const FreeFeatures& b)
      : scales_(*b.frame->scales), camera_1_(*a.frame->camera), camera_2_(*b.frame->camera) {
    on_image_ = camera_1_.is_flat() && camera_2_.is_pinhole();
    if (camera_1_.is_rig() || camera_2_.is_rig()) {
      T_21_ = b.T_cw * a.T_cw.inverse();
      add_epipoles_of_rig();
      return;
    }
    epipoles_.emplace_back();
    const Eigen::Matrix3d K_1 = calibration_of(camera_1_);
    const Eigen::Matrix3d K_2 = on_image_ ? calibration_of(camera_2_) : Eigen::Matrix3d::Identity();
    F_ = fundamental_matrix(a.T_cw, b.T_cw, K_1, K_2);
    const Eigen::Vector3d center = b.T_cw * a.T_cw.center();
    Eigen::Vector2d epipole;
    if (camera_2_.project(center, epipole)) epipoles_[0].push_back(epipole);
    // A fisheye lens may show the line through both cameras at both its ends.
    if (!camera_2_.is_flat() && camera_2_.project(-center, epipole)) {
      epipoles_[0].push_back(epipole);
    }
  }

  void select(const Keypoint& feature_1) {
    selected_ = camera_1_.camera_at(feature_1.x);
    if (T_21_) return select_of_rig(feature_1);
    const Eigen::Vector3d h = camera_1_.is_flat() ? Eigen::Vector3d(feature_1.x, feature_1.y, 1.0)
                                                  : camera_1_.ray(feature_1.x, feature_1.y);
    line_ = F_.transpose() * h;
    squared_normal_ = line_.head<2>().squaredNorm();
  }

  // Near the epipole every feature lies on every line, and depth cannot be triangulated.
  bool near_epipole(const Keypoint& feature_2) const {
    for (const Eigen::Vector2d& epipole : epipoles_[selected_]) {
      const double du = epipole.x() - feature_2.x, dv = epipole.y() - feature_2.y;
      if (du * du + dv * dv < kEpipoleExclusion * scales_.scale(feature_2.level)) return true;
    }
    return false;
  }

  bool on_line(const Keypoint& feature_2) const {
    const double gate = kEpipolarGate * scales_.sigma2(feature_2.level);
    if (!on_image_) return squared_distance(feature_2) < gate;
    if (!(squared_normal_ > 0)) return false;
    const double offset = line_.x() * feature_2.x + line_.y() * feature_2.y + line_.z();
    return offset * offset / squared_normal_ < gate;
  }

 private:
  // Epipoles: the image of every camera of 1 in every camera of 2.
  void add_epipoles_of_rig() {
    for (std::size_t i = 0; i < camera_1_.n_cameras(); ++i) {
      auto& epipoles = epipoles_.emplace_back();
      const Eigen::Vector3d center = *T_21_ * camera_1_.centre(camera_1_.column_of(i));
      for (std::size_t j = 0; j < camera_2_.n_cameras(); ++j) {
        const Eigen::Vector3d opposite = 2 * camera_2_.centre(camera_2_.column_of(j)) - center;
        Eigen::Vector2d epipole;
        if (camera_2_.project_into(j, center, epipole)) epipoles.push_back(epipole);
        if (camera_2_.project_into(j, opposite, epipole)) epipoles.push_back(epipole);
      }
    }
  }

  // The normals of the planes of a feature and each camera of 2.
  void select_of_rig(const Keypoint& feature_1) {
    const Eigen::Vector3d ray = T_21_->rotation() * camera_1_.ray(feature_1.x, feature_1.y);
    const Eigen::Vector3d center = *T_21_ * camera_1_.centre(feature_1.x);
    normals_.resize(camera_2_.n_cameras());
    for (std::size_t j = 0; j < normals_.size(); ++j) {
      normals_[j] = (center - camera_2_.centre(camera_2_.column_of(j))).cross(ray);
    }
  }

  // Distance [raw pixels] of a feature of 2 from the epipolar plane, whose normal in camera 2 is
  // line_.
  double squared_distance(const Keypoint& feature_2) const {
    const Eigen::Vector3d ray = camera_2_.ray(feature_2.x, feature_2.y);
    const Eigen::Matrix3d B = camera_2_.sight(feature_2.x, feature_2.y).leftCols<3>();
    const Eigen::Vector3d& normal = T_21_ ? normals_[camera_2_.camera_at(feature_2.x)] : line_;
    const double scale = B.row(2).dot(ray);
    const Eigen::Matrix<double, 3, 2> by_pixel = scale * B.inverse().leftCols<2>();
    const double offset = normal.dot(ray);
    return offset * offset / (by_pixel.transpose() * normal).squaredNorm();
  }

  const ScalePyramid& scales_;
  const Camera &camera_1_, &camera_2_;
  bool on_image_;  // lines of image 2, otherwise planes
  Eigen::Matrix3d F_;
  std::optional<Pose> T_21_;  // of rigs
  // Images of camera 1 that camera 2 can see, for each camera of 1.
  std::vector<std::vector<Eigen::Vector2d>> epipoles_;
  std::vector<Eigen::Vector3d> normals_;  // for each camera of a rig 2
  std::size_t selected_ = 0;              // camera of 1
  Eigen::Vector3d line_ = Eigen::Vector3d::Zero();
  double squared_normal_ = 0;
};

// The pairs of match_for_triangulation(). Marks the matched features of b as occupied.
FeaturePairs find_pairs(const FreeFeatures& a, FreeFeatures& b) {
  const Frame& frame_a = *a.frame;
  const Frame& frame_b = *b.frame;
  EpipolarGeometry geometry(a, b);
  FeaturePairs pairs;
  thread_local std::vector<std::uint32_t> free_b;
  for_each_common_node(frame_a, frame_b, [&](NodeFeatures node_a, NodeFeatures node_b) {
    // Computed once for all features of a, because the processor cannot predict which features of b
    // are free.
    free_b.clear();
    for (const std::uint32_t j : node_b) {
      if (b.occupied[j]) continue;
      __builtin_prefetch(&frame_b.descriptors[j]);
      free_b.push_back(j);
    }
    if (free_b.empty()) return;
    for (const std::uint32_t i : node_a) {
      if (a.occupied[i]) continue;
      bool selected = false;  // most features have no similar one in b, and need no line
      int best = kDescriptorLow;
      std::int64_t match = -1;
      for (const std::uint32_t j : free_b) {
        const int distance = hamming_distance(frame_a.descriptors[i], frame_b.descriptors[j]);
        if (distance > best) continue;  // the last of equals wins
        if (b.occupied[j]) continue;    // matched to an earlier feature of a
        if (!selected) geometry.select(frame_a.keypoints[i]);
        selected = true;
        const Keypoint& feature = frame_b.keypoints[j];
        const bool has_depth = frame_a.has_depth(i) || frame_b.has_depth(j);
        if (!has_depth && geometry.near_epipole(feature)) continue;
        if (!geometry.on_line(feature)) continue;
        best = distance;
        match = j;
      }
      if (match < 0) continue;
      b.occupied[static_cast<std::size_t>(match)] = 1;
      pairs.emplace_back(i, static_cast<std::uint32_t>(match));
    }
  });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

// Whether the cameras are far enough apart for new points to have a reliable depth.
bool wide_enough(const Map& map, const KeyFrame& current, const KeyFrame& neighbour,
                 bool monocular) {
  const double distance = (neighbour.center() - current.center()).norm();
  if (!monocular) return distance >= neighbour.frame->camera->baseline();
  const std::optional<double> depth = median_scene_depth(map, neighbour);
  return depth && distance / *depth >= kLeastBaselinePerDepth;
}

struct NewPoint {
  std::uint32_t feature_1, feature_2;
  Eigen::Vector3d position;
};

// Adds the points whose keyframes still live and have not moved, and whose keypoints are still
// free.
void commit(Map& map, KeyFrameId id_1, const Pose& T_1w, KeyFrameId id_2, const Pose& T_2w,
            const std::vector<NewPoint>& points, std::vector<MapPointId>& created) {
  const KeyFrame* keyframe_1 = map.find(id_1);
  const KeyFrame* keyframe_2 = map.find(id_2);
  if (!stands_at(keyframe_1, T_1w) || !stands_at(keyframe_2, T_2w)) return;
  for (const NewPoint& point : points) {
    if (map.find(keyframe_1->map_points[point.feature_1]) ||
        map.find(keyframe_2->map_points[point.feature_2])) {
      continue;
    }
    const MapPointId id = map.add_point(point.position, id_1, keyframe_1->frame->id);
    map.add_observation(id, id_1, point.feature_1);
    map.add_observation(id, id_2, point.feature_2);
    map.update_point(id);
    created.push_back(id);
  }
}

// One neighbour: copy under the read lock, match and triangulate without, commit in one section.
void create_with_neighbour(Map& map, std::uint64_t epoch, KeyFrameId id_1, KeyFrameId id_2,
                           bool monocular, std::vector<MapPointId>& created) {
  std::optional<FreeFeatures> view_1, view_2;
  {
    const auto lock = map.read_lock();
    const KeyFrame* current = map.find(id_1);
    const KeyFrame* neighbour = map.find(id_2);
    if (map.epoch() != epoch || !current || !neighbour) return;
    if (!wide_enough(map, *current, *neighbour, monocular)) return;
    view_1 = gather(map, id_1);
    view_2 = gather(map, id_2);
  }
  const PairTriangulation triangulation(*view_1->frame, view_1->T_cw, *view_2->frame, view_2->T_cw);
  std::vector<NewPoint> points;
  for (const auto& [i, j] : find_pairs(*view_1, *view_2)) {
    if (const auto position = triangulation(i, j)) points.push_back({i, j, *position});
  }
  if (points.empty()) return;
  const auto lock = map.write_lock();
  if (map.epoch() == epoch) {
    commit(map, id_1, view_1->T_cw, id_2, view_2->T_cw, points, created);
  }
}

}  // namespace

FeaturePairs match_for_triangulation(const Map& map, KeyFrameId a, KeyFrameId b) {
  std::optional<FreeFeatures> view_a, view_b;
  {
    const auto lock = map.read_lock();
    view_a = gather(map, a);
    view_b = gather(map, b);
  }
  if (!view_a || !view_b) return {};
  return find_pairs(*view_a, *view_b);
}

std::vector<MapPointId> create_new_points(Map& map, KeyFrameId current,
                                          const NewPointOptions& options,
                                          const std::atomic<bool>* should_stop) {
  std::vector<KeyFrameId> neighbours;
  std::uint64_t epoch = 0;
  {
    const auto lock = map.read_lock();
    if (!map.find(current)) return {};
    epoch = map.epoch();
    neighbours = map.best_neighbours(current, options.n_neighbours);
  }
  std::vector<MapPointId> created;
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    if (i > 0 && should_stop && should_stop->load()) break;
    create_with_neighbour(map, epoch, current, neighbours[i], options.monocular, created);
  }
  return created;
}

}  // namespace orbslam
