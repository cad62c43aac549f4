// SPDX-License-Identifier: BSD-3-Clause
// What is kept per thread between calls is as before after one that ran out of memory.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <thread>
#include <utility>
#include <vector>

#include "map/local_map.hpp"
#include "map_builder.hpp"

namespace {

/// Allocations of this thread until one fails, once; negative: none does.
thread_local int n_until_failure = -1;

}  // namespace

// Not inline: the compiler takes what it sees of only one of a pair for a mistake.
[[gnu::noinline]] void* operator new(std::size_t size) {
  if (n_until_failure >= 0 && n_until_failure-- == 0) throw std::bad_alloc();
  if (void* const memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return std::malloc(size > 0 ? size : 1);
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace orbslam::testing {
namespace {

/// Keyframe 3 shares 30, 20 and 16 points with those before it; nothing is counted yet.
struct Scene : MapBuilder {
  std::vector<MapPointId> points;
  Scene() {
    add_keyframes(4);
    for (const auto& [n, k] : {std::pair(30, 0), {20, 1}, {16, 2}}) {
      for (const MapPointId id : add_points(n, kfs({k, 3}))) points.push_back(id);
    }
  }
};

/// Lets `use` fail in one scene at its first, second, third... allocation, until it does not, and
/// looks at what it does in another scene afterwards. Each time in a new thread, which has kept
/// nothing yet.
template <class Use, class Look>
void use_after_every_failure(const Use& use, const Look& look) {
  bool failed = true;
  for (int n = 0; failed; ++n) {
    failed = false;
    Scene half_done, scene;
    std::thread([&] {
      n_until_failure = n;
      try {
        use(half_done);
      } catch (const std::bad_alloc&) {
        failed = true;
      }
      n_until_failure = -1;
      look(scene, use(scene));
    }).join();
    ASSERT_FALSE(::testing::Test::HasFailure()) << "after failure of allocation " << n;
  }
}

TEST(OutOfMemory, ConnectionsAreCountedFromZero) {
  use_after_every_failure(
      [](Scene& scene) {
        scene.map.update_connections(kf(3));
        return 0;
      },
      [](const Scene& scene, int) {
        EXPECT_EQ(scene.map.find(kf(3))->neighbours, kfs({0, 1, 2}));
        EXPECT_EQ(scene.map.weight(kf(3), kf(0)), 30);
        EXPECT_EQ(scene.map.weight(kf(3), kf(1)), 20);
        EXPECT_EQ(scene.map.weight(kf(3), kf(2)), 16);
        EXPECT_EQ(scene.violations(), "");
      });
}

TEST(OutOfMemory, LocalMapsAreCollectedFromNothing) {
  use_after_every_failure(
      [](Scene& scene) {
        TrackedFrame frame = frame_seeing(scene.map, scene.points);
        return select_local_map(scene.map, frame);
      },
      [](const Scene& scene, const LocalMap& local) {
        EXPECT_EQ(local.keyframes, kfs({0, 1, 2, 3}));
        EXPECT_EQ(local.reference_keyframe, kf(3));
        EXPECT_EQ(local.points.size(), scene.points.size());
      });
}

}  // namespace
}  // namespace orbslam::testing
