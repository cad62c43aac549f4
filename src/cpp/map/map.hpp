// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <unordered_map>
#include <vector>

#include "map/id_table.hpp"
#include "map/keyframe.hpp"
#include "map/map_point.hpp"
#include "map/noise_factors.hpp"

namespace orbslam {

/// Pose of a keyframe, and KeyFrame::scale.
struct ScaledPose {
  Pose T_cw;
  double scale = 1;
};

/// Owner of keyframes and map points, the covisibility graph and the spanning tree.
///
/// It holds any number of maps, each in a world of its own, that share ids. Every keyframe, and
/// with it every point, belongs to one of them; observations, covisibility, loop edges and the
/// spanning tree never cross between two. One map is active: new keyframes belong to it. The others
/// rest.
///
/// Locking: the methods below do not lock. Callers hold `read_lock()` for const methods and
/// `write_lock()` for the others, in sections that neither solve, nor extract, nor match more
/// than one pair of keyframes, nor wait, nor call Python. No other lock is taken inside.
///
/// Ids are never reused before clear(). A pointer returned by find() is valid while the lock is
/// held; across sections keep ids and look them up again.
///
/// See docs/method/map.md#keyframes and what follows it, docs/method/threads.md#locks.
class Map {
  friend class MapContentsAccess;  // map/contents.cpp, restore.cpp: the map as a whole

 public:
  // See docs/method/map.md#covisibility and docs/method/loops.md#essential-graph.
  static constexpr int kCovisibilityThreshold = 15;  ///< shared points that make a neighbour
  static constexpr int kEssentialWeight = 100;       ///< shared points of an essential-graph edge

  Map() = default;
  Map(const Map&) = delete;
  Map& operator=(const Map&) = delete;

  [[nodiscard]] std::shared_lock<std::shared_mutex> read_lock() const {
    return std::shared_lock(mutex_);
  }
  [[nodiscard]] std::unique_lock<std::shared_mutex> write_lock() {
    return std::unique_lock(mutex_);
  }

  // ---- look-up ---------------------------------------------------------------------------------
  /// nullptr when the object is dead or never existed.
  const KeyFrame* find(KeyFrameId id) const { return keyframes_.find(id); }
  const MapPoint* find(MapPointId id) const { return points_.find(id); }
  /// The living successor of a replaced point; an invalid id when the point died.
  MapPointId resolve(MapPointId id) const;

  /// Published and unpublished keyframes, ascending.
  std::vector<KeyFrameId> keyframe_ids() const;
  std::vector<MapPointId> point_ids() const;
  std::size_t n_keyframes() const { return n_published_; }  ///< of all maps, published ones only
  std::size_t n_points() const { return points_.size(); }
  template <class Visitor>
  void for_each_keyframe(Visitor&& visit) const {
    keyframes_.for_each(visit);
  }
  template <class Visitor>
  void for_each_point(Visitor&& visit) const {
    points_.for_each(visit);
  }

  /// The objects, with the stamp of each one's last change for followers of the map
  /// (map/changes.hpp). Changes of keyframes: birth, death, pose, scale, publication, processing,
  /// parent, loop edges and weights. Changes of points: birth, death, position, direction and scale
  /// range, descriptor and observations; not the tracker's counters.
  const IdTable<KeyFrameId, KeyFrame>& keyframe_table() const { return keyframes_; }
  const IdTable<MapPointId, MapPoint>& point_table() const { return points_; }

  // ---- several maps ----------------------------------------------------------------------------
  /// The one that new keyframes belong to. Needs no lock.
  MapIndex active_map() const { return active_map_.load(); }
  /// Maps with keyframes, ascending: the oldest first.
  std::vector<MapIndex> maps() const;
  /// The map of a keyframe, living or culled; kNoMap for an unknown one.
  MapIndex map_of(KeyFrameId id) const;
  /// The map of a living point, or of what has replaced it; kNoMap for a dead one.
  MapIndex map_of(MapPointId id) const;
  /// Whether a point belongs to a map.
  bool is_in(const MapPoint& point, MapIndex map) const;
  /// The first keyframe of a map, root of its spanning tree; never dies. Invalid for a map without
  /// keyframes.
  KeyFrameId root(MapIndex map) const;
  bool is_root(const KeyFrame& keyframe) const { return root(keyframe.map) == keyframe.id; }
  std::size_t n_keyframes_of(MapIndex map) const;  ///< published ones only
  /// The third axis of the map's world is up, by an IMU, and its unit is the metre. Trajectories of
  /// other maps are relative to the root.
  bool is_upright(MapIndex map) const;
  void set_upright(MapIndex map);
  /// The next keyframe begins a map beside the present ones, which becomes the active one. Nothing
  /// changes while the active one has no keyframe. Returns the active map.
  MapIndex begin_map();
  /// Throws StateError for a map without keyframes.
  void activate_map(MapIndex map);
  /// Drops a map with all that belongs to it; the youngest of the others becomes active if it was.
  /// Returns its keyframes, so that the owner of a keyframe index can erase them.
  std::vector<KeyFrameId> erase_map(MapIndex map);
  /// Moves all objects of one map to another map. They are in the other map's world already. Their
  /// spanning tree is attached with `child` under `parent`. Throws StateError when these are not a
  /// living keyframe of each.
  void join_maps(KeyFrameId child, KeyFrameId parent);

  // ---- keyframes -------------------------------------------------------------------------------
  /// A new keyframe with empty slots, not yet published. The frame must be described (words) if a
  /// vocabulary is in use; nobody changes it afterwards.
  KeyFrameId add_keyframe(std::shared_ptr<const Frame> frame, const Pose& T_cw);
  /// Makes the keyframe part of the keyframe set (idempotent). A keyframe that has no parent yet
  /// hangs provisionally under the published keyframe before it, so that the tree spans its map.
  void publish(KeyFrameId id);
  /// Records that process_new_keyframe() has finished with the keyframe.
  void mark_processed(KeyFrameId id) { changing(id).processed = true; }
  /// Only for a keyframe not yet published: notes a match (or its absence, with an invalid id)
  /// whose observation process_new_keyframe() adds later. The slot must not hold an observation.
  void set_slot(KeyFrameId id, std::size_t index, MapPointId point);
  void set_pose(KeyFrameId id, const Pose& T_cw);
  /// Notes that lengths around the keyframe have been multiplied by `factor` (see KeyFrame::scale).
  void rescale(KeyFrameId id, double factor);

  /// Removes a keyframe: neighbours forget it, its points lose the observation (and may die), its
  /// children find new parents among the neighbours they share most points with, and its pose
  /// relative to the parent is archived for trajectories. Returns false, and only marks it, while
  /// leases or loop edges protect it. Roots never die and dead ones do not die again
  /// (returns false).
  bool erase_keyframe(KeyFrameId id);

  /// A counted protection against erase_keyframe(). Throws StateError for a dead keyframe.
  void begin_lease(KeyFrameId id);
  /// The last release carries out a deferred death, unless a loop edge protects the keyframe now.
  /// The request is cleared in both cases. Ignored when clear() removed the keyframe meanwhile.
  /// Returns whether the keyframe died; the owner of a keyframe index then erases it there.
  bool end_lease(KeyFrameId id);
  /// Adds the edge on both keyframes; both are protected for ever.
  void add_loop_edge(KeyFrameId a, KeyFrameId b);
  /// Throws StateError when that would make a cycle or give a root a parent.
  void set_parent(KeyFrameId child, KeyFrameId parent);

  /// Pose of a keyframe, living or culled: a culled one is expressed through its archived pose
  /// relative to its parent at the time of its death. Throws StateError for an unknown id.
  Pose T_cw(KeyFrameId id) const { return scaled_pose(id).T_cw; }
  ScaledPose scaled_pose(KeyFrameId id) const;
  /// The keyframe itself, or the nearest of its ancestors that lives; an invalid id for an unknown
  /// one.
  KeyFrameId living(KeyFrameId id) const;

  // ---- points ----------------------------------------------------------------------------------
  /// A new point without observations; the caller adds them, then calls update_point().
  MapPointId add_point(const Eigen::Vector3d& position, KeyFrameId reference, FrameId first_frame);
  void set_position(MapPointId id, const Eigen::Vector3d& position);
  /// Sets the position with the direction and scale range that geometry_at() has computed.
  void set_geometry(MapPointId id, const PointGeometry& geometry);
  /// Direction and scale range of the point if it were at `position` and the camera of its k-th
  /// observation at centers[k].
  PointGeometry geometry_at(const MapPoint& point, const Eigen::Vector3d& position,
                            const std::vector<Eigen::Vector3d>& centers) const;

  // Methods that create or move an object throw StateError for a dead or unknown id, which is an
  // error of the caller. Methods that remove, refresh or count ignore such an id.

  /// Both sides at once. Does nothing when the point is already observed in the keyframe or the
  /// slot holds another living point.
  void add_observation(MapPointId point, KeyFrameId keyframe, std::size_t index);
  /// Both sides at once. The point dies when its weighted count drops to 2 or less; a lost
  /// reference keyframe is replaced by the observer with the lowest id.
  void erase_observation(MapPointId point, KeyFrameId keyframe);
  void erase_point(MapPointId id);
  /// Moves the observations of `id` to `by` (where `by` is not observed yet), adds the counters,
  /// refreshes `by`; `id` dies and resolve(id) gives `by`. `by` is resolved first; nothing happens
  /// when both are the same or `by` is dead.
  void replace_point(MapPointId id, MapPointId by);
  /// Counters of the tracker: seen in the frustum, matched as inlier. Replacements are followed.
  /// The read lock is enough.
  void count_visible(MapPointId id, int n = 1) const;
  void count_found(MapPointId id, int n = 1) const;

  /// Representative descriptor: the observed one with the least median distance to the others.
  void update_descriptor(MapPointId id);
  /// Mean viewing direction and scale range.
  void update_geometry(MapPointId id);
  void update_point(MapPointId id) {
    update_descriptor(id);
    update_geometry(id);
  }

  // ---- aligned sightings (docs/method/alignment.md) --------------------------------------------
  /// Sets or takes away (null) the reference sighting of a point; ignores a dead one.
  void set_patch(MapPointId id, std::shared_ptr<const PointPatch> patch);
  /// Stores the aligned observation of a slot. Ignores a dead keyframe, and a slot that holds
  /// another point now.
  void set_aligned(KeyFrameId id, std::size_t index, const AlignedSighting& sighting);
  /// Removes it; the observation uses the keypoint's pixel again.
  void clear_aligned(KeyFrameId id, std::size_t index);
  /// Measured ratio of the noise of aligned pixels to that of corners.
  NoiseFactors& noise() { return noise_; }
  const NoiseFactors& noise() const { return noise_; }

  // ---- covisibility ----------------------------------------------------------------------------
  /// Recounts the shared points of a keyframe with all others, keeps the graph symmetric, and
  /// gives the keyframe its parent (the strongest neighbour that is not its descendant) the first
  /// time that it has neighbours.
  void update_connections(KeyFrameId id);
  /// The first n of KeyFrame::neighbours; none for a culled keyframe.
  std::vector<KeyFrameId> best_neighbours(KeyFrameId id, std::size_t n) const;
  int weight(KeyFrameId a, KeyFrameId b) const;

  // ---- the map as a whole ----------------------------------------------------------------------
  /// Drops everything and starts a new epoch and a new map: ids restart, work begun before must not
  /// commit.
  /// The big-change index restarts too; the versions go on growing.
  void clear();
  std::uint64_t epoch() const { return epoch_.load(); }
  /// Grows when poses or points moved as a whole (loop correction, full bundle adjustment).
  std::uint64_t big_change_index() const { return big_change_index_.load(); }
  void count_big_change() { ++big_change_index_; }
  /// Grows with every change of structure (objects, observations) and of geometry (poses, points).
  std::uint64_t structure_version() const { return structure_version_.load(); }
  std::uint64_t geometry_version() const { return geometry_version_.load(); }

 private:
  struct Part {
    KeyFrameId root;
    std::size_t n_published = 0;
    bool upright = false;
  };
  struct ArchivedKeyFrame {
    KeyFrameId parent;
    Pose T_kp;                           ///< maps the parent's camera frame to the dead keyframe's
    double scale = 1, parent_scale = 1;  ///< KeyFrame::scale of both at that time
  };

  KeyFrame& keyframe(KeyFrameId id);
  MapPoint& point(MapPointId id);
  // The same for a change that followers must see.
  KeyFrame& changing(KeyFrameId id);
  MapPoint& changing(MapPointId id);
  const KeyFrame& keyframe(KeyFrameId id) const;

  void insert_observation(MapPoint& point, KeyFrame& keyframe, std::size_t index);
  void refresh_descriptor(MapPoint& point);
  void refresh_geometry(MapPoint& point);
  void remember_replacement(MapPointId id, MapPointId by);
  void forget_old_replacements();

  static bool set_weight(KeyFrame& keyframe, KeyFrameId other, int weight);
  static void sort_neighbours(KeyFrame& keyframe);
  void forget_covisibility(KeyFrame& dying);

  bool is_in_subtree(KeyFrameId id, KeyFrameId root) const;
  void make_root_of_tree(KeyFrame& keyframe);
  void link(KeyFrame& child, KeyFrameId parent);
  void choose_parent(KeyFrame& keyframe);
  void adopt_children(KeyFrame& dying, KeyFrameId grandparent);

  mutable std::shared_mutex mutex_;
  IdTable<KeyFrameId, KeyFrame> keyframes_;
  IdTable<MapPointId, MapPoint> points_;
  std::unordered_map<KeyFrameId, ArchivedKeyFrame> archive_;
  /// Successors of replaced points. Entries older than kReplacementMemory keyframes are removed. An
  /// id that is held for longer resolves to a dead point, which is safe.
  static constexpr std::int64_t kReplacementMemory = 50;
  std::unordered_map<MapPointId, MapPointId> replaced_by_;
  std::deque<std::pair<KeyFrameId, MapPointId>> replacements_;
  KeyFrameId next_keyframe_{0};
  MapPointId next_point_{0};
  std::size_t n_published_ = 0;
  std::map<MapIndex, Part> parts_{{0, {}}};  // the active one is among them
  NoiseFactors noise_;
  MapIndex last_map_ = 0;
  std::atomic<MapIndex> active_map_{0};
  std::atomic<std::uint64_t> epoch_{0}, big_change_index_{0};
  std::atomic<std::uint64_t> structure_version_{0}, geometry_version_{0};
};

}  // namespace orbslam
