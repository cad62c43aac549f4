// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "base/errors.hpp"
#include "places/golden_vocabulary.hpp"

namespace orbslam {
namespace {

using ::testing::HasSubstr;

class VocabularyFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("vocabulary_" +
               std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name = "v.bvoc") const { return (folder_ / name).string(); }
  std::string golden_bytes() const {
    testing::golden_vocabulary()->save(path());
    std::ifstream file(path(), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::string open_error(const std::string& bytes) const {
    std::ofstream(path("broken.bvoc"), std::ios::binary) << bytes;
    try {
      Vocabulary::open(path("broken.bvoc"));
    } catch (const VocabularyError& error) {
      return error.what();
    }
    return "no error";
  }
  std::filesystem::path folder_;
};

VocabularyHeader header_of(const std::string& bytes) {
  VocabularyHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  return header;
}

/// The bytes with a changed header whose checksum is right again.
template <class Change>
std::string with_header(std::string bytes, Change change) {
  VocabularyHeader header = header_of(bytes);
  change(header);
  header.header_hash = hash_bytes(&header, offsetof(VocabularyHeader, header_hash), 0);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

TEST_F(VocabularyFile, RoundTrip) {
  const auto built = testing::golden_vocabulary();
  built->save(path(), "from a test", {12, 34, 56});
  const auto opened = Vocabulary::open(path());
  EXPECT_EQ(opened->hash(), built->hash());
  EXPECT_EQ(opened->comment(), "from a test");
  EXPECT_EQ(opened->source().size, 12U);
  EXPECT_EQ(opened->source().mtime_ns, 34);
  EXPECT_EQ(opened->source().hash, 56U);
  EXPECT_EQ(opened->n_words(), 1000U);
  opened->check_content();

  WordVector a, b;
  DirectIndex index_a, index_b;
  const auto descriptors = testing::read_descriptors("desc0");
  built->transform(descriptors, a, index_a);
  opened->transform(descriptors, b, index_b);
  EXPECT_EQ(a.words, b.words);
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(index_a.indices, index_b.indices);

  opened->save(path("again.bvoc"));
  EXPECT_EQ(Vocabulary::open(path("again.bvoc"))->comment(), "from a test");
  EXPECT_EQ(std::filesystem::file_size(path()), std::filesystem::file_size(path("again.bvoc")));
}

TEST_F(VocabularyFile, SectionsAreAlignedAndTheRestIsGone) {
  const std::string bytes = golden_bytes();
  const VocabularyHeader header = header_of(bytes);
  for (const auto offset : {header.centres, header.child_count, header.link, header.original_id,
                            header.weight, header.comment}) {
    EXPECT_EQ(offset % 64, 0U);
  }
  EXPECT_EQ(header.total_size, bytes.size());
  // Only the vocabulary itself is left, no temporary file.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
}

TEST_F(VocabularyFile, SavingOverAnOpenFileKeepsItUsable) {
  testing::golden_vocabulary()->save(path());
  const auto opened = Vocabulary::open(path());
  const auto hash = opened->hash();
  const auto small = Vocabulary::from_nodes(2, 1, Scoring::kL1, Weighting::kTfIdf,
                                            {{0, true, {}, 1}, {0, true, {}, 1}});
  small->save(path());
  opened->check_content();
  EXPECT_EQ(opened->hash(), hash);
  EXPECT_EQ(Vocabulary::open(path())->n_words(), 2U);
}

TEST_F(VocabularyFile, MissingFileOrFolderIsNamed) {
  for (const std::string& name : {path("nothing.bvoc"), folder_.string()}) {
    try {
      Vocabulary::open(name);
      FAIL();
    } catch (const VocabularyError& error) {
      EXPECT_THAT(error.what(), HasSubstr(name));
    }
  }
}

TEST_F(VocabularyFile, CannotBeWrittenIsNamed) {
  const std::string name = path("no/such/folder/v.bvoc");
  try {
    testing::golden_vocabulary()->save(name);
    FAIL();
  } catch (const VocabularyError& error) {
    EXPECT_THAT(error.what(), HasSubstr(name + ": cannot be written: No such file"));
  }
}

TEST_F(VocabularyFile, EveryTruncationIsAnError) {
  const std::string bytes = golden_bytes();
  for (std::size_t size = 0; size < bytes.size(); size += size < 400 ? 1 : 997) {
    EXPECT_THAT(open_error(bytes.substr(0, size)), HasSubstr("broken.bvoc")) << size;
  }
  EXPECT_THAT(open_error(bytes + "x"), HasSubstr("incomplete"));
}

TEST_F(VocabularyFile, EveryFlippedByteIsAnError) {
  const std::string bytes = golden_bytes();
  for (std::size_t at = 0; at < bytes.size(); at += at < 400 ? 1 : 499) {
    // Padding between sections belongs to the content as well.
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_THAT(open_error(damaged), HasSubstr("broken.bvoc")) << at;
  }
}

TEST_F(VocabularyFile, RandomBytesAreAnError) {
  std::mt19937_64 random(1);
  const std::string bytes = golden_bytes();
  for (int round = 0; round < 50; ++round) {
    std::string noise(256 + random() % 4096, '\0');
    for (char& c : noise) c = static_cast<char>(random());
    EXPECT_NE(open_error(noise), "no error");
    EXPECT_NE(open_error(bytes.substr(0, 64) + noise), "no error");
  }
}

TEST_F(VocabularyFile, AnotherVersionOrByteOrderIsNamed) {
  const std::string bytes = golden_bytes();
  EXPECT_THAT(open_error(with_header(bytes, [](VocabularyHeader& h) { h.version = 2; })),
              HasSubstr("format version 2"));
  EXPECT_THAT(
      open_error(with_header(bytes, [](VocabularyHeader& h) { h.endian_tag = 0x04030201; })),
      HasSubstr("byte order"));
}

// Files that a program wrote with matching checksums but senseless numbers.
TEST_F(VocabularyFile, ForgedHeadersAreErrors) {
  const std::string bytes = golden_bytes();
  EXPECT_THAT(open_error(with_header(bytes, [](VocabularyHeader& h) { h.n_nodes = 1U << 30; })),
              HasSubstr("inconsistent sizes"));
  EXPECT_THAT(open_error(with_header(bytes, [](VocabularyHeader& h) { h.n_words = 0; })),
              HasSubstr("inconsistent sizes"));
  EXPECT_THAT(open_error(with_header(bytes, [](VocabularyHeader& h) { h.weight = ~0ULL; })),
              HasSubstr("inconsistent sizes"));
  EXPECT_THAT(open_error(with_header(bytes, [](VocabularyHeader& h) { h.branching = 9; })),
              HasSubstr("inconsistent"));
  EXPECT_THAT(open_error(with_header(bytes, [](VocabularyHeader& h) { h.depth = 2; })),
              HasSubstr("inconsistent"));
}

TEST_F(VocabularyFile, ForgedLinksAreErrors) {
  const std::string bytes = golden_bytes();
  const VocabularyHeader header = header_of(bytes);
  for (const std::uint32_t node : {0U, 5U, 50U, 500U}) {
    for (const std::uint32_t value : {0U, 1000U, 0xffffffffU}) {
      std::string damaged = bytes;
      std::memcpy(damaged.data() + header.link + 4 * node, &value, 4);
      EXPECT_NE(open_error(damaged), "no error") << node << " " << value;
    }
    std::string damaged = bytes;
    damaged[header.child_count + node] = 7;
    EXPECT_THAT(open_error(damaged), HasSubstr("tree is inconsistent")) << node;
  }
}

}  // namespace
}  // namespace orbslam
