#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/mapping/localiser.hpp>
#include <sidestep/mapping/map_check.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/tracker.hpp>
#include <sidestep/robot/base_joints.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep {

/// What one step of the mapping loop did and how long each stage took, wall time.
struct MappingStep {
  std::int64_t frame_sequence = 0;
  Stamp stamp;
  MapUpdate update;
  std::optional<Localisation> localisation;  ///< Nothing without a Localiser.
  double read_ms = 0.0;                      ///< Source; not part of the frame time.
  double localise_ms = 0.0;
  double integrate_ms = 0.0;
  double field_ms = 0.0;    ///< The mask of what is tracked included.
  double motion_ms = 0.0;   ///< Detecting and tracking what moves, where that is asked for.
  double publish_ms = 0.0;  ///< The swap; and freeing the field before, unless a reader holds it.

  /// From the frame in hand to the published field.
  [[nodiscard]] double frame_ms() const noexcept {
    return localise_ms + integrate_ms + field_ms + motion_ms + publish_ms;
  }
};

/// Stage names in error messages, e.g. "mapper voxel_grid".
struct StageNames {
  std::string source = "source";
  std::string mapper = "mapper";
  std::string field = "field";
  std::string localiser = "localiser";
};

/// Moves a frame, and the joint positions of a robot with such a base, into another frame.
void move_frame(Frame& frame, const Transform& T_new_old, const std::optional<BaseJoints>& base);

/// The mapping loop: Source -> (Localiser ->) Mapper -> FieldBuilder -> SnapshotSlot (Finean 2021,
/// Fig. 2). Owns nothing but the order of the calls. [mapping]
class MappingPipeline {
 public:
  struct Parts {
    Source& source;
    Mapper& mapper;
    FieldBuilder& field_builder;
    SnapshotSlot& slot;
    Log& log;
    StageNames names = {};
    /// Looks for what moves in every map of a mapper with an OccupancyView; may be null.
    MotionDetector* motion_detector = nullptr;
    /// Skips frames until something is known in the map: one that knows nothing is not published.
    bool waits_for_content = false;
    /// Tracks what the motion detector finds; may be null, and is not used without that.
    Tracker* tracker = nullptr;
    /// Builds the field without what is tracked. A field that needs another view than the
    /// OccupancyView keeps it, which is logged once.
    bool masks_tracks = false;
    /// Finds out where frames were taken; null: where they say.
    Localiser* localiser = nullptr;
    /// Of the robot in the frames, with a localiser.
    std::optional<BaseJoints> base = {};
  };
  explicit MappingPipeline(Parts parts)
      : parts_(std::move(parts)),
        occupancy_(dynamic_cast<const OccupancyView*>(&parts_.mapper)),
        map_check_(parts_.mapper) {}

  /// Binds the field builder to the mapper. Call once, first.
  [[nodiscard]] Result<void> attach();

  /// Maps the next frame and publishes the field; nothing at the end of the stream. An
  /// unusable frame is counted and skipped, and logged, unless the one before it was for the same
  /// reason.
  [[nodiscard]] Result<std::optional<MappingStep>> step(const Deadline& deadline);

  /// Why frames were skipped, one by one, since they were last taken.
  [[nodiscard]] const std::vector<Error>& bad_frames() const noexcept { return bad_frames_; }
  [[nodiscard]] std::vector<Error> take_bad_frames() { return std::exchange(bad_frames_, {}); }

 private:
  void skip(Error error);
  /// Takes a frame into the map's frame, if there is a localiser.
  [[nodiscard]] Result<void> localise(Frame& frame, MappingStep& step);
  /// Binds the field builder to the masked map, if that can be.
  [[nodiscard]] Result<bool> attach_masked();
  /// What moves and what is tracked after a frame, as far as that is asked for, without a field.
  [[nodiscard]] MapSnapshot follow_motion(const Frame& frame);
  /// Whether anything has been known in the map so far; true of mappers that do not tell.
  [[nodiscard]] bool has_content();

  Parts parts_;
  const OccupancyView* occupancy_;  ///< Of the mapper; null where it has none.
  MapCheck map_check_;
  MotionMemory memory_;
  std::shared_ptr<const DistanceField> newest_;  ///< Kept for the localiser.
  bool is_lost_ = false;                         ///< The localiser, at the last frame.
  std::optional<CameraView> camera_;             ///< Of the first sensor, at its last frame.
  std::optional<MaskedOccupancy> masked_;        ///< What the field sees, where tracks are masked.
  bool has_content_ = false;
  std::vector<Error> bad_frames_;
  std::string skipped_for_;  ///< The last frame; empty: it was mapped.
};

}  // namespace sidestep
