// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "map/map.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

/// A point seen once by each of n keyframes with these descriptors; the representative one.
Descriptor representative(const std::vector<Descriptor>& descriptors) {
  Map map;
  MapPointId point;
  for (std::size_t k = 0; k < descriptors.size(); ++k) {
    FeatureSpec feature;
    feature.descriptor = descriptors[k];
    const auto id =
        map.add_keyframe(make_synthetic_frame(static_cast<FrameId>(k), {feature}), Pose());
    if (k == 0) point = map.add_point({0, 0, 5}, id, 0);
    map.add_observation(point, id, 0);
  }
  map.update_descriptor(point);
  return map.find(point)->descriptor;
}

std::vector<Descriptor> thermometers(const std::vector<int>& counts) {
  std::vector<Descriptor> descriptors;
  for (const int n : counts) descriptors.push_back(thermometer_descriptor(n));
  return descriptors;
}

/// The definition, written out: full matrix, full sort.
Descriptor by_definition(const std::vector<Descriptor>& descriptors) {
  std::size_t best = 0;
  int least = 1000;
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::vector<int> row;
    for (const Descriptor& other : descriptors) {
      row.push_back(hamming_distance(descriptors[i], other));
    }
    std::sort(row.begin(), row.end());
    const int median = row[static_cast<std::size_t>(0.5 * static_cast<double>(row.size() - 1))];
    if (median < least) {
      least = median;
      best = i;
    }
  }
  return descriptors[best];
}

TEST(RepresentativeDescriptor, OneOrTwoObserversGiveTheFirst) {
  EXPECT_EQ(representative(thermometers({7})), thermometer_descriptor(7));
  EXPECT_EQ(representative(thermometers({9, 3})), thermometer_descriptor(9));
}

TEST(RepresentativeDescriptor, LeastMedianIncludingTheZeroOfTheDiagonal) {
  // Distances: row 0: 0 100 110, row 1: 0 10 100, row 2: 0 10 110. Element 1 of each sorted row:
  // 100, 10, 10; the tie between the last two goes to the first of them.
  EXPECT_EQ(representative(thermometers({0, 100, 110})), thermometer_descriptor(100));
  // Five: element 2. Rows of 50 and 0: 30; of 20: 0 10 20 30 180 and of 30: 0 10 20 30 170 -> 20,
  // a tie that the earlier one wins. With 60 in the place of 50 the row of 30 gives 30.
  EXPECT_EQ(representative(thermometers({50, 0, 20, 30, 200})), thermometer_descriptor(20));
  EXPECT_EQ(representative(thermometers({50, 0, 30, 20, 200})), thermometer_descriptor(30));
  EXPECT_EQ(representative(thermometers({60, 0, 30, 20, 200})), thermometer_descriptor(20));
}

TEST(RepresentativeDescriptor, ATieKeepsTheLowestKeyframe) {
  EXPECT_EQ(representative(thermometers({10, 20, 30, 40})), thermometer_descriptor(10));
  EXPECT_EQ(representative(thermometers({40, 30, 20, 10})), thermometer_descriptor(40));
}

// OD-56: also beyond the observers whose distances lie on the stack.
TEST(RepresentativeDescriptor, EqualsTheDefinitionForAnyNumberOfObservers) {
  std::mt19937_64 random(3);
  for (std::size_t n = 1; n <= 60; ++n) {
    // Few different distances make ties likely.
    std::vector<Descriptor> descriptors;
    for (std::size_t i = 0; i < n; ++i) {
      descriptors.push_back(thermometer_descriptor(static_cast<int>(uniform_index(random, 40))));
    }
    EXPECT_EQ(representative(descriptors), by_definition(descriptors)) << n << " thermometers";
    const Descriptor base = random_descriptor(random);
    for (Descriptor& descriptor : descriptors) {
      descriptor = flip_bits(base, static_cast<int>(uniform_index(random, 60)), random);
    }
    EXPECT_EQ(representative(descriptors), by_definition(descriptors)) << n << " noisy copies";
  }
}

}  // namespace
}  // namespace orbslam::testing
