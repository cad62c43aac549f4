// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/descriptor.hpp"

namespace orbslam {

// The binary vocabulary format ("BVOC", version 1), little-endian, read by memory map.
//
// A 256-byte header, then sections that begin at multiples of 64 bytes, in this order:
//
//   centres      32 bytes per node, byte i of the descriptor at offset i (the root's are zero)
//   child_count  u8 per node, 0: a word
//   link         u32 per node: the first child of an inner node, the word id of a leaf
//   original_id  u32 per node: its number in the text format (line n describes node n)
//   weight       f64 per word
//   comment      UTF-8 text: where the vocabulary comes from, its licence
//
// Nodes are numbered breadth-first with siblings adjacent, the root is node 0: the children of one
// node are one block of memory, and `link` of the inner nodes is ascending without gaps. See
// docs/method/words.md#vocabulary.

/// A vocabulary made from a text file remembers which one, so that it can serve as its cache.
struct VocabularySource {
  std::uint64_t size = 0;  ///< bytes
  std::int64_t mtime_ns = 0;
  std::uint64_t hash = 0;  ///< of samples of the content, 0 when there is no source
};

/// The first 256 bytes of the file.
struct VocabularyHeader {
  char magic[4];
  std::uint32_t version;
  std::uint32_t endian_tag;
  std::uint32_t branching;
  std::uint32_t depth;
  std::uint32_t scoring;
  std::uint32_t weighting;
  std::uint32_t descriptor_bytes;
  std::uint64_t n_nodes;  ///< the root included
  std::uint64_t n_words;
  std::uint64_t comment_size;
  std::uint64_t total_size;  ///< of the file, bytes
  // Offsets from the begin of the file.
  std::uint64_t centres, child_count, link, original_id, weight, comment;
  std::uint64_t content_hash;  ///< branching .. weighting and all sections but the comment
  VocabularySource source;
  std::uint64_t reserved[12];
  std::uint64_t comment_hash;
  std::uint64_t header_hash;  ///< of the bytes before this field
};
static_assert(sizeof(VocabularyHeader) == 256);

/// 64-bit hash of bytes, taken as little-endian words of 8 bytes, the last one padded with zeros.
std::uint64_t hash_bytes(const void* data, std::size_t size, std::uint64_t seed);

/// Bytes of a whole vocabulary file, in memory or mapped from disk.
class VocabularyImage {
 public:
  /// Zeroed memory for a vocabulary of this size; the header has its sizes and offsets filled in.
  static VocabularyImage allocate(std::uint64_t n_nodes, std::uint64_t n_words);
  /// Maps a file read-only and shared. Throws VocabularyError when it cannot be opened or is too
  /// short for a header.
  static VocabularyImage map(const std::string& path);

  const std::byte* data() const { return data_.get(); }
  std::size_t size() const { return size_; }
  const VocabularyHeader& header() const {
    return *reinterpret_cast<const VocabularyHeader*>(data());
  }

  const Descriptor* centres() const { return section<Descriptor>(header().centres); }
  const std::uint8_t* child_count() const { return section<std::uint8_t>(header().child_count); }
  const std::uint32_t* link() const { return section<std::uint32_t>(header().link); }
  const std::uint32_t* original_id() const { return section<std::uint32_t>(header().original_id); }
  const double* weight() const { return section<double>(header().weight); }
  std::string comment() const;

  // Only for an allocated image.
  VocabularyHeader& edit_header() {
    return *reinterpret_cast<VocabularyHeader*>(const_cast<std::byte*>(data()));
  }
  template <class Item>
  Item* edit(const Item* section) {
    return const_cast<Item*>(section);
  }
  /// Computes the hashes after the sections and the tree's parameters have been written.
  void seal();

  /// Throws VocabularyError unless header, sizes and tree are consistent, so that every look-up
  /// stays inside the file. Reads the small tables only; files up to kSmallFile bytes have their
  /// whole content compared with the hash as well.
  void check(const std::string& name) const;
  /// Throws VocabularyError unless the whole content has the hash of the header.
  void check_content(const std::string& name) const;

  static constexpr std::size_t kSmallFile = std::size_t{16} << 20;

 private:
  template <class Item>
  const Item* section(std::uint64_t offset) const {
    return reinterpret_cast<const Item*>(data() + offset);
  }
  void check_header(const std::string& name) const;
  void check_tree(const std::string& name) const;
  std::uint64_t content_hash() const;

  std::shared_ptr<const std::byte> data_;
  std::size_t size_ = 0;
};

/// Writes the image with another comment and source stamp, under a temporary name that is renamed
/// at the end. Throws VocabularyError naming the path.
void write_vocabulary(const VocabularyImage& image, const std::string& path,
                      const std::string& comment, const VocabularySource& source);

}  // namespace orbslam
