#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/measures/map_truth.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// Resolutions that differ by less are the same.
inline constexpr double kSameResolution = 1e-9;

/// One entry of `experiment.systems`: a mapper and a field, as the configuration has them.
struct SystemEntry {
  std::string name;
  Node mapper;
  Node field;
  Node is_signed;  ///< true, false or a list of both; nothing: as the field is by itself.
  std::string published;

  static Parameters<SystemEntry> parameters();
};

/// One entry of `experiment.published`: what somebody printed of a system.
struct PublishedEntry {
  std::string name;
  bool is_signed = false;
  std::vector<double> resolutions_m;
  std::vector<double> frame_ms;

  static Parameters<PublishedEntry> parameters();
};

/// `experiment.expect`: what every system must reach for the run to be a success.
struct ExpectSettings {
  std::optional<double> max_error_m;
  std::optional<double> collision_recall;
  std::optional<double> appear_frames;
  std::optional<double> gone_frames;
  std::optional<double> ghost_vox;

  static Parameters<ExpectSettings> parameters();
};

/// The `experiment` block of a mapping benchmark.
struct MappingBenchmarkSettings : ExperimentSettings {
  std::vector<SystemEntry> systems;
  std::vector<double> resolutions_m;
  Eigen::Vector3d origin_m{-4.0, -4.0, -0.1};
  Eigen::Vector3d extent_m{8.0, 8.0, 3.2};
  double max_distance_m = 0.8;
  std::int64_t frames = 0;
  int stride = 1;
  int frames_in_memory = 400;
  std::string clock = "every_frame";
  std::int64_t accuracy_every = 100;
  std::string reference;
  std::string published_as = "published";
  std::vector<PublishedEntry> published;
  TruthSettings truth;
  ExpectSettings expect;

  static Parameters<MappingBenchmarkSettings> parameters();

  [[nodiscard]] bool on_every_frame() const { return clock != "real_time"; }
  [[nodiscard]] bool in_real_time() const { return clock != "every_frame"; }
};

/// One system at one resolution: what there is to measure.
struct SystemCase {
  std::string name;
  std::string mapper;  ///< Name of the plugin.
  std::string field;
  std::optional<bool> is_signed;  ///< As asked for; nothing: whatever the field is.
  bool unknown_occupied = false;  ///< What the field takes unseen voxels for.
  double resolution_m = 0.0;
  std::optional<double> published_ms;
  Node mapper_block;  ///< With everything that the experiment sets filled in.
  Node field_block;
};

/// The cases of an `experiment` block that fits its schema: by system, then signed or not, then
/// resolution. Appends every mistake in it, those in the systems' plugin blocks included, at its
/// position. The experiment sets `resolution_m`, `size_vox` and `origin_m` of mappers and
/// `max_distance_m` and `signed` of fields, whatever the plugin.
[[nodiscard]] std::vector<SystemCase> read_cases(const Node& experiment, Host& host,
                                                 std::vector<Error>& errors);

}  // namespace sidestep
