// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "camera/camera.hpp"
#include "support/cameras.hpp"
#include "support/npy.hpp"
#include "support/random_numbers.hpp"

namespace orbslam::testing {

inline double normal(std::mt19937_64& random) {
  const double radius = std::sqrt(-2 * std::log(uniform(random, 1e-12, 1)));
  return radius * std::cos(uniform(random, 0, 6.283185307179586));
}

inline double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 57.29577951308232;
}

inline double rotation_error_degrees(const Pose& a, const Pose& b) {
  return a.rotation().angularDistance(b.rotation()) * 57.29577951308232;
}

template <class T>
Array<T> golden(const std::string& set, const std::string& array) {
  return read_npy<T>(test_data("golden/" + set + "/" + array + ".npy"));
}

inline std::shared_ptr<const Camera> golden_camera(const std::string& set) {
  const auto K = golden<double>(set, "K");
  return make_camera({K.values[0], K.values[1], K.values[2], K.values[3]});
}

enum class SceneShape { general, planar };

/// Points seen by two cameras, projected with noise; keypoint i matches keypoint i.
struct TwoViewScene {
  std::shared_ptr<const Camera> camera = make_camera({520, 525, 320, 240});
  Pose T_21;
  std::vector<Eigen::Vector3d> points;  // frame of camera 1
  std::vector<Eigen::Vector2f> initial, current;
  std::vector<int> matches;
};

/// The keypoints of a golden set.
inline TwoViewScene golden_two_views(const std::string& set) {
  const auto uv_1 = golden<float>(set, "uv1"), uv_2 = golden<float>(set, "uv2");
  TwoViewScene scene;
  for (std::size_t i = 0; i < uv_1.rows(); ++i) {
    scene.initial.emplace_back(uv_1.at(i, 0), uv_1.at(i, 1));
    scene.current.emplace_back(uv_2.at(i, 0), uv_2.at(i, 1));
    scene.matches.push_back(static_cast<int>(i));
  }
  return scene;
}

inline TwoViewScene make_two_view_scene(SceneShape shape, const Pose& T_21, std::size_t count,
                                        double noise, std::uint64_t seed,
                                        double outlier_share = 0) {
  std::mt19937_64 random(seed);
  TwoViewScene scene;
  scene.T_21 = T_21;
  const Eigen::Vector3d plane_normal = Eigen::Vector3d(uniform(random, -0.5, 0.5), 0.3, -1);
  while (scene.points.size() < count) {
    const double u = uniform(random, 10, 630), v = uniform(random, 10, 470);
    const Eigen::Vector3d ray = scene.camera->unproject(u, v, 1);
    const double depth =
        shape == SceneShape::planar ? -6.0 / plane_normal.dot(ray) : uniform(random, 3, 9);
    const Eigen::Vector3d point = depth * ray, p_2 = T_21 * point;
    if (!(depth > 1 && depth < 20) || p_2.z() < 0.5) continue;
    Eigen::Vector2d pixel_2 = scene.camera->pinhole().project(p_2);
    if (uniform(random, 0, 1) < outlier_share) {
      pixel_2 = {uniform(random, 0, 640), uniform(random, 0, 480)};
    }
    const auto shift = [&] { return noise * normal(random); };
    scene.points.push_back(point);
    scene.initial.emplace_back(static_cast<float>(u + shift()), static_cast<float>(v + shift()));
    scene.current.emplace_back(static_cast<float>(pixel_2.x() + shift()),
                               static_cast<float>(pixel_2.y() + shift()));
    scene.matches.push_back(static_cast<int>(scene.matches.size()));
  }
  return scene;
}

inline Pose sideways_motion() {
  return Pose(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.06, Eigen::Vector3d(0.2, 1, 0.1).normalized())),
      Eigen::Vector3d(-0.8, 0.1, 0.15));
}

}  // namespace orbslam::testing
