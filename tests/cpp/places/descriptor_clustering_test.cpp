// SPDX-License-Identifier: BSD-3-Clause
#include "places/descriptor_clustering.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace orbslam {
namespace {

Descriptor noise(std::mt19937_64& random) { return {{random(), random(), random(), random()}}; }

Descriptor flip(const Descriptor& middle, std::mt19937_64& random, int n_bits) {
  Descriptor descriptor = middle;
  for (int i = 0; i < n_bits; ++i) {
    const auto bit = random() % 256;
    descriptor.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

struct Problem {
  std::vector<Descriptor> descriptors;
  std::vector<std::uint32_t> multiplicities;

  void add(const Descriptor& descriptor, std::uint32_t multiplicity = 1) {
    descriptors.push_back(descriptor);
    multiplicities.push_back(multiplicity);
  }
  Clustering solve(const ClusteringOptions& options, std::uint64_t seed = 1) const {
    return cluster_descriptors({descriptors.data(), multiplicities.data(), descriptors.size()},
                               options, seed, [] { return true; });
  }
};

/// `n` descriptors around each of `n_groups` random ones, group after group.
Problem groups(int n_groups, int n, int n_bits) {
  std::mt19937_64 random(7);
  Problem problem;
  for (int group = 0; group < n_groups; ++group) {
    const Descriptor middle = noise(random);
    for (int i = 0; i < n; ++i) problem.add(flip(middle, random, n_bits));
  }
  return problem;
}

TEST(ClusterDescriptors, FindsSeparatedGroups) {
  const Clustering clustering = groups(5, 200, 10).solve({5, 100, 2, 1});
  ASSERT_EQ(clustering.centres.size(), 5U);
  std::set<int> found;
  for (std::size_t group = 0; group < 5; ++group) {
    found.insert(clustering.cluster_of[group * 200]);
    for (std::size_t i = 0; i < 200; ++i) {
      EXPECT_EQ(clustering.cluster_of[group * 200 + i], clustering.cluster_of[group * 200]);
    }
  }
  EXPECT_EQ(found.size(), 5U);
}

TEST(ClusterDescriptors, ThreadsDoNotChangeTheResult) {
  const Problem problem = groups(20, 150, 60);
  const Clustering one = problem.solve({10, 100, 1, 1});
  for (const int n_threads : {2, 3, 7}) {
    const Clustering many = problem.solve({10, 100, 1, n_threads});
    EXPECT_EQ(many.centres, one.centres);
    EXPECT_EQ(many.cluster_of, one.cluster_of);
  }
}

TEST(ClusterDescriptors, SeedsChangeTheResultReproducibly) {
  const Problem problem = groups(20, 50, 80);
  EXPECT_EQ(problem.solve({10, 100, 1, 1}, 3).cluster_of,
            problem.solve({10, 100, 1, 1}, 3).cluster_of);
  EXPECT_NE(problem.solve({10, 100, 1, 1}, 3).cluster_of,
            problem.solve({10, 100, 1, 1}, 4).cluster_of);
}

TEST(ClusterDescriptors, FewDescriptorsAreAClusterEach) {
  const Problem problem = groups(3, 1, 0);
  const Clustering clustering = problem.solve({10, 100, 1, 1});
  EXPECT_EQ(clustering.centres, problem.descriptors);
}

TEST(ClusterDescriptors, NoClusterIsEverEmpty) {
  // Majority centres can drift away from all members; the original then goes on with an empty
  // centre and crashes. Many small random problems meet it. (OD-43)
  std::mt19937_64 random(11);
  for (int round = 0; round < 300; ++round) {
    Problem problem;
    const Descriptor middle = noise(random);
    for (int i = 0; i < 30; ++i) problem.add(flip(middle, random, 3));
    const Clustering clustering = problem.solve({8, 20, 1, 1}, static_cast<std::uint64_t>(round));
    const std::set<int> used(clustering.cluster_of.begin(), clustering.cluster_of.end());
    EXPECT_EQ(used.size(), clustering.centres.size());
    EXPECT_EQ(clustering.centres.size(), 8U);
  }
}

TEST(ClusterDescriptors, MajorityCountsMultiplicitiesAndTiesGiveOne) {
  // Two far groups of two; inside a group the heavier descriptor wins, equal weights give ones.
  Descriptor zero, low, all, high;
  low.words = {1, 0, 0, 0};
  all.words = {~0ULL, ~0ULL, ~0ULL, ~0ULL};
  high.words = {~1ULL, ~0ULL, ~0ULL, ~0ULL};
  Problem problem;
  problem.add(zero, 300);
  problem.add(low, 299);
  problem.add(all, 5);
  problem.add(high, 5);
  const Clustering clustering = problem.solve({2, 100, 2, 1});
  ASSERT_EQ(clustering.centres.size(), 2U);
  EXPECT_EQ(clustering.cluster_of[0], clustering.cluster_of[1]);
  EXPECT_EQ(clustering.cluster_of[2], clustering.cluster_of[3]);
  EXPECT_EQ(clustering.centres[clustering.cluster_of[0]], zero);
  EXPECT_EQ(clustering.centres[clustering.cluster_of[2]], all);
}

// OD-45: k-means may swing for ever, so its iterations are limited.
TEST(ClusterDescriptors, IterationCapAndCancelEndIt) {
  const Problem problem = groups(20, 150, 60);
  int n_asked = 0;
  const auto count = [&](int n) {
    n_asked = 0;
    return [&n_asked, n] { return ++n_asked < n; };
  };
  const DescriptorSet set{problem.descriptors.data(), problem.multiplicities.data(),
                          problem.descriptors.size()};
  cluster_descriptors(set, {10, 3, 1, 1}, 1, count(1000));
  EXPECT_EQ(n_asked, 3);
  cluster_descriptors(set, {10, 0, 1, 1}, 1, count(2));
  EXPECT_EQ(n_asked, 2);
}

}  // namespace
}  // namespace orbslam
