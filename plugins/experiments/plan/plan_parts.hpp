#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/measures/point_survey.hpp>
#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/report/canvas.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/task_settings.hpp>

namespace sidestep {

// Mapping.

/// Result of mapping.
struct MapRecord {
  std::vector<MappingStep> steps;
  std::vector<Error> bad_frames;
  std::shared_ptr<const DistanceField> field;
  std::int64_t occupied_vox = 0;
  std::int64_t known_vox = 0;
  std::string left_out;  ///< Which frames of the source are not in it, in words; empty if all are.
  std::string empty_reason;  ///< Why there is nothing in it to plan among; empty if there is.
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended the run before its end, mapping or planning.
};

/// A depth image kept for the report: every n-th pixel.
struct DepthPicture {
  std::int64_t frame_sequence = 0;
  StoredArray depth_m;
};

/// Passes on at most `limit` frames (0: all) of another source, and keeps some depth images,
/// spread evenly over them. [mapping]
class FrameTap final : public Source {
 public:
  /// `count`: frames that the source has; nothing where it cannot be known.
  FrameTap(Source& source, std::optional<std::int64_t> count, std::int64_t limit, int pictures);

  [[nodiscard]] Result<std::optional<Frame>> next(const Deadline& deadline) override;
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override;

  /// Whether to keep a copy of the last frame that was passed on.
  void keep_last(bool keeps) noexcept { keeps_last_ = keeps; }
  /// Null before the first one that was kept.
  [[nodiscard]] const std::shared_ptr<const Frame>& last() const noexcept { return last_; }

  /// Surveys the points of what is passed on from now on, in the mapper's grid.
  void survey(const Mapper& mapper, PointSurvey survey) {
    mapper_ = &mapper;
    survey_ = survey;
  }
  [[nodiscard]] const PointSurvey& survey() const noexcept { return survey_; }

  [[nodiscard]] const std::vector<DepthPicture>& pictures() const noexcept { return pictures_; }

  /// "mapped the first 300 of 1000 frames" where the limit ended the stream; else empty.
  [[nodiscard]] std::string left_out() const;

 private:
  void keep(const Frame& frame);

  Source& source_;
  std::optional<std::int64_t> count_;
  std::int64_t limit_;
  int wanted_;
  std::int64_t passed_ = 0;  ///< Frames asked for, usable or not.
  bool is_cut_ = false;      ///< The limit ended the stream.
  std::int64_t stride_ = 1;  ///< Every stride_-th frame is kept.
  std::vector<DepthPicture> pictures_;
  bool keeps_last_ = false;
  std::shared_ptr<const Frame> last_;
  const Mapper* mapper_ = nullptr;
  PointSurvey survey_;
};

/// Series "depth": the kept depth images.
[[nodiscard]] StoredRow<DepthPicture> stored_picture();

/// Maps every frame of the source, and records what it took and what was seen; stops early on
/// request or at a fault, with what there is.
[[nodiscard]] Result<MapRecord> map_frames(MappingPipeline& pipeline, const FrameTap& source,
                                           const OccupancyView& occupancy, SnapshotSlot& slot,
                                           Recorder& recorder, ExperimentContext& context);

// Planning.

/// Result of retiming a path.
struct RetimingRecord {
  double before_s = 0.0;   ///< The optimiser's duration; the plan's own is the trajectory's.
  double deviation = 0.0;  ///< Of any joint from the optimiser's path, m or rad.
  double retime_ms = 0.0;
};

/// Result of one plan.
struct PlanRecord {
  std::string name;
  std::shared_ptr<const RobotModel> robot;  ///< With all that it carries in this plan.
  std::vector<std::string> attached;        ///< Names of that.
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;  ///< With an end-effector goal, only where the search begins.
  Task task;
  int attempts = 0;
  Solution solution;  ///< Its trajectory is the one to be sent: retimed, where that was asked for.
  std::optional<RetimingRecord> retiming;
  std::optional<Verdict> field_verdict;  ///< Spheres against the field that was planned in.
  std::optional<Verdict> voxel_verdict;  ///< Shapes against the occupied voxels.
  std::optional<Verdict> scene_verdict;  ///< Shapes against the true scene, where it is known.
  std::string certified;                 ///< By leave_certificate(), where that was asked for.
  std::string reason;                    ///< Why it is not a success; empty if it is.
  bool interrupted = false;

  [[nodiscard]] bool success() const noexcept { return reason.empty(); }
  [[nodiscard]] bool has_trajectory() const noexcept { return solution.trajectory.size() > 0; }
  [[nodiscard]] bool valid_independent() const noexcept {
    return voxel_verdict && voxel_verdict->valid() && (!scene_verdict || scene_verdict->valid());
  }
  /// The smaller of both checks in the map; nothing if none was made. The true scene, whose floor
  /// the robot stands on, has its clearance in its own verdict.
  [[nodiscard]] std::optional<double> min_clearance_m() const noexcept;
  /// Whether that is as far as was looked: nothing was found nearer.
  [[nodiscard]] bool clearance_is_bound() const noexcept;
};

/// Everything that the plans of a run share: one robot, one pinned snapshot, and the checks of
/// both kinds against it. Built once mapping is over.
struct PlanningContext {
  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const DistanceField> field;
  const OccupancyView& occupancy;
  PlanningSettings planning;  ///< With the floor that the robot stands on.
  CheckSettings check;
  std::unique_ptr<ValidityCheck> field_check = nullptr;
  std::unique_ptr<ValidityCheck> voxel_check = nullptr;
  std::unique_ptr<ValidityCheck> scene_check = nullptr;  ///< Null where no scene is known.
  /// All that is checked against, and who may touch what of the scene; for certificates.
  ShapeObstacles obstacles = {};
  std::vector<AllowedContact> allowed = {};
};

/// Who plans.
struct Planners {
  PluginPtr<Optimiser> optimiser;
  PluginPtr<Optimiser> sampler;  ///< Null where there is none.
};

/// Makes one plan, attempt by attempt. One that fails is a record with a reason; an error is a
/// fault of a planner's or of a check's.
[[nodiscard]] Result<void> make_plan(const PlanningContext& context, const Planners& planners,
                                     std::uint64_t seed, Log& log, std::stop_token stop,
                                     PlanRecord& plan);

/// Where what is left of a plan lies, from the run's folder on.
[[nodiscard]] std::string file_of(const std::string& folder, std::string plan,
                                  const std::string& extension);

// Results.

/// Series "joint": names, units and limits.
[[nodiscard]] StoredRow<Joint> stored_joint();

/// Series "plan" (one item a plan), and of the plan with index `item`: "trajectory/ITEM"
/// (support states), "motion/ITEM" (joints and clearance, sampled densely over time) and
/// "slice/ITEM" (the field at these heights, the robot's cut spheres and the paths of base and
/// hand; no heights: chosen from the plan).
void record_plan(const PlanRecord& plan, std::int64_t item, const PlanningContext& context,
                 std::span<const double> slice_heights_m, Recorder& recorder);

/// What a pixel of a slice is.
enum class SliceState { kFree = 0, kUnknown = 1, kOccupied = 2, kOutside = 3 };

/// A cut through the field and through the robot's way, in coordinates (u, v) of a plane. Rows
/// of the arrays run along v, upwards.
struct FieldSlice {
  std::string title;
  std::string u_label;
  std::string v_label;
  double u0_m = 0.0;  ///< Of the first pixel's centre.
  double v0_m = 0.0;
  double step_m = 0.0;
  StoredArray distance_m;
  StoredArray state;      ///< SliceState.
  StoredArray circles;    ///< n x 4: u, v, radius, share of the motion's time (0 to 1).
  StoredArray base_path;  ///< n x 2, projected onto the plane; empty if the base stands still.
  StoredArray tip_path;   ///< n x 2.
};

[[nodiscard]] StoredRow<FieldSlice> stored_slice();

/// The pictures of the map: depth images and frame times, as far as they were recorded.
[[nodiscard]] Result<std::vector<Figure>> map_figures(ResultsReader& results);

/// The pictures of one plan: slices, joints, velocities, clearance, as far as they were recorded.
[[nodiscard]] Result<std::vector<Figure>> plan_figures(ResultsReader& results, std::int64_t item,
                                                       const std::string& name);

/// Verdict, summary.json and table of a finished (or interrupted) plan experiment.
[[nodiscard]] ExperimentOutcome summarise_plans(const RunProvenance& provenance,
                                                const MapRecord& map,
                                                std::span<const PlanRecord> plans);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& plan_report();

}  // namespace sidestep
