#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/core/time.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/host.hpp>

#include "study_settings.hpp"

namespace sidestep {

using StudyBox = Eigen::AlignedBox3d;

/// The boxes of one scene: sides, then centres, each coordinate uniform in the robot's ranges.
/// Depends on the seed, the robot's name and the scene's number alone.
[[nodiscard]] std::vector<StudyBox> draw_boxes(const StudyRobotEntry& robot, int boxes, int scene,
                                               std::uint64_t seed);

/// Mean of the boxes' sides, along the axes along which they vary; 0 for no box.
[[nodiscard]] double mean_side_m(const StudyRobotEntry& robot, std::span<const StudyBox> boxes);

/// States of a robot, uniform in the joints' ranges, each free of self-collision and with every
/// sphere inside `grid`. Fails with kConfig where hardly any state is.
[[nodiscard]] Result<std::vector<Eigen::VectorXd>> draw_states(
    const StudyRobot& study, const std::shared_ptr<const RobotModel>& robot, int count,
    std::uint64_t seed);

/// The exact signed distance to boxes, within a kilometre of the origin: what trajectories are
/// judged against. Knows no voxels.
[[nodiscard]] std::shared_ptr<const SceneField> true_field(std::span<const StudyBox> boxes);

/// The map of a scene: a voxel is occupied where its cube and a box overlap, as it is in a map of
/// a scene whose surfaces were all seen and whose insides are full.
class BoxMap final : public Mapper, public OccupancyView {
 public:
  explicit BoxMap(const GridSpec& grid);

  /// Replaces the scene; what changed against the one before.
  [[nodiscard]] MapUpdate set_boxes(std::span<const StudyBox> boxes);

  /// Scenes come from set_boxes(); frames are refused.
  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override;
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, words_per_row_}; }

 private:
  void fill(const StudyBox& box);

  GridSpec grid_;
  int words_per_row_ = 0;
  std::vector<std::uint64_t> occupied_;
  std::vector<std::uint64_t> known_;
  std::int64_t sequence_ = 0;
};

/// The two kinds of field that a study compares, as indices.
inline constexpr std::size_t kUnsigned = 0;
inline constexpr std::size_t kSigned = 1;
inline constexpr std::array<const char*, 2> kFieldNames = {"unsigned", "signed"};

/// What one field led to on one problem.
struct FieldOutcome {
  bool attempted = false;  ///< False where the problem was skipped: nothing else is meaningful.
  SolveStatus status = SolveStatus::kFailed;
  bool collision_free = false;  ///< In the true scene, over continuous time.
  int iterations = 0;           ///< That changed the trajectory, as GPMP2 counts them.
  int steps = 0;                ///< Tried, accepted or not.
  double cost = 0.0;
  double clearance_m = 0.0;  ///< Least, to the true scene; infinity without obstacles.
  double solve_ms = 0.0;
  double check_ms = 0.0;
};

/// One row of the study: a pair of states in a scene.
struct ProblemOutcome {
  std::int64_t problem = 0;  ///< scene * pairs + pair.
  bool start_free = false;
  bool goal_free = false;
  std::array<FieldOutcome, 2> fields;

  [[nodiscard]] bool is_attempted() const noexcept {
    return fields[0].attempted && fields[1].attempted;
  }
  [[nodiscard]] bool is_solvable() const noexcept {
    return fields[0].collision_free || fields[1].collision_free;
  }
  [[nodiscard]] bool is_solved_by_both() const noexcept {
    return fields[0].collision_free && fields[1].collision_free;
  }
};

/// What all problems of one scene share. Immutable; any thread.
struct StudyScene {
  int scene = 0;
  std::array<std::shared_ptr<const DistanceField>, 2> fields;
  std::shared_ptr<const ValidityCheck> check;  ///< Against the true scene, obstacles alone.
  std::vector<char> state_free;                ///< By state.
};

/// The states of a pair: 0 is (0, 1), then (0, 2), ....
[[nodiscard]] std::pair<int, int> states_of_pair(std::int64_t pair, int states);

/// Solves problems of one robot, one after the other; one object a thread. The optimiser is the
/// configuration's, from a straight line; what is collision-free is for scene.check to say.
struct StudySolver {
  const StudyRobot& study;
  std::shared_ptr<const RobotModel> robot;
  std::span<const Eigen::VectorXd> states;
  PluginPtr<Optimiser> optimiser;
  bool skips_collisions;

  /// Fails with kCancelled where the deadline passes, and with what the optimiser fails with.
  [[nodiscard]] Result<ProblemOutcome> solve(const StudyScene& scene, std::int64_t pair,
                                             const Deadline& deadline);
  /// The same in one kind of field.
  [[nodiscard]] Result<FieldOutcome> solve_in(const StudyScene& scene, std::size_t kind, int start,
                                              int goal, const Deadline& deadline);
};

}  // namespace sidestep
