#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/robot/robot_model.hpp>

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

/// The exact signed distance to boxes, everywhere: what trajectories are judged against. Knows no
/// voxels; everything is known, nothing is outside.
class BoxField final : public DistanceField {
 public:
  explicit BoxField(std::vector<StudyBox> boxes);

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override;

 private:
  std::vector<StudyBox> boxes_;
};

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

}  // namespace sidestep
