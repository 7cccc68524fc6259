#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/field/occupancy_bits.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "robot_clearance.hpp"
#include "view_message.hpp"

namespace sidestep {

// What a run tells, as messages of docs/reference/viewer.md. Numbers that are not finite are null.
// [any]

[[nodiscard]] ViewMessage world_message(const ObservedWorld& world);

/// The same with `recorded`: true, for a page that plays it; what is no message is left as it is.
[[nodiscard]] ViewMessage recorded_world(const ViewMessage& world);

/// The bits of these blocks. `stamp` is that of the newest frame in them.
[[nodiscard]] ViewMessage map_message(Stamp time, Stamp stamp, const OccupancyBits& bits,
                                      std::span<const std::int32_t> blocks, bool full);

/// `T_world_link`: of all links; T_world_object: of the objects that move.
[[nodiscard]] ViewMessage state_message(const ObservedStep& step,
                                        std::span<const Transform> T_world_link,
                                        std::span<const Transform> T_world_object,
                                        const std::optional<Clearance>& clearance);

/// What is tracked and predicted, either of which may be null.
[[nodiscard]] ViewMessage tracks_message(Stamp time, const Tracks* tracks,
                                         const Prediction* prediction);

/// Nothing for a frame without a depth image.
[[nodiscard]] std::optional<ViewMessage> frame_message(Stamp time, const Frame& frame);

/// `role`: "followed" or "refused". `start` is the trajectory's time 0.
[[nodiscard]] ViewMessage plan_message(Stamp time, std::string_view role,
                                       const Trajectory& trajectory, Stamp start,
                                       const RobotModel& robot);

[[nodiscard]] ViewMessage event_message(const ObservedEvent& event);
/// What an event says, as that message has it.
[[nodiscard]] nlohmann::ordered_json event_json(const ObservedEvent& event);
/// The event that a true contact is, known once its episode is over; what it says.
[[nodiscard]] ViewMessage contact_message(const TrueContact& contact);
[[nodiscard]] nlohmann::ordered_json contact_json(const TrueContact& contact);

/// What took how long, since the message before.
struct ViewTiming {
  /// stamp_s, received_s, published_s, integrate_ms, field_ms.
  std::vector<std::array<double, 5>> frames;
  std::vector<std::array<double, 2>>
      steps;                        ///< time_s, step_ms: the longest of a tenth of a second.
  std::int64_t checks = 0;          ///< So far.
  std::int64_t frames_dropped = 0;  ///< So far.
};
[[nodiscard]] ViewMessage timing_message(Stamp time, const ViewTiming& timing);

/// Distances on a plane across a field.
struct FieldSlice {
  static constexpr std::int16_t kUnknown = -32768;
  static constexpr int kMostSamples = 256;  ///< Along either axis.

  SliceRequest request;                   ///< Its position moved into the grid.
  Eigen::Vector3d first_m;                ///< The first sample.
  double step_m = 0.0;                    ///< From one sample to the next; whole voxels.
  int columns = 0;                        ///< Along the first of the other axes.
  int rows = 0;                           ///< Along the second one.
  double max_distance_m = 0;              ///< Where distances are cut off.
  std::vector<std::int16_t> distance_mm;  ///< Row by row; kUnknown where nothing was observed.
};

/// The slice that a page asks for: at every voxel's centre, or at every n-th one's of a large grid.
/// With a time ahead, also of what is predicted for then, so long after `now`; may be null.
[[nodiscard]] FieldSlice make_slice(const DistanceField& field, SliceRequest request,
                                    const Prediction* prediction = nullptr, Stamp now = {});
/// `stamp` is that of the newest frame in the field.
[[nodiscard]] ViewMessage slice_message(Stamp time, Stamp stamp, const FieldSlice& slice);

[[nodiscard]] ViewMessage end_message(const ObservedEnd& end);

/// Of all links, world frame. [any]; allocates.
[[nodiscard]] std::vector<Transform> link_poses(const RobotModel& robot, std::span<const double> q);

/// The first and the last link that a sphere is on: base and tool. 0 without spheres.
[[nodiscard]] int base_link(const RobotDescription& robot) noexcept;
[[nodiscard]] int tool_link(const RobotDescription& robot) noexcept;

}  // namespace sidestep
