#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep::pcd {

/// One point, the mean, for all points in a cube (pcl::VoxelGrid).
struct VoxelFilter {
  double leaf_m = 0.02;
  static Parameters<VoxelFilter> parameters();
};

/// Drops points whose neighbours are far away (pcl::StatisticalOutlierRemoval, Rusu 2008).
struct OutlierFilter {
  int neighbours = 20;
  double deviations = 2.0;
  static Parameters<OutlierFilter> parameters();
};

/// Keeps the points in a box, or those outside (pcl::CropBox).
struct CropFilter {
  Eigen::Vector3d min_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d max_m = Eigen::Vector3d::Zero();
  std::string frame = "world";
  std::string keep = "inside";
  static Parameters<CropFilter> parameters();
};

/// Removes the points of the largest plane (RANSAC, pcl::RandomSampleConsensus).
struct PlaneFilter {
  double distance_m = 0.02;
  double min_share = 0.2;
  int iterations = 200;
  static Parameters<PlaneFilter> parameters();
};

/// One filter of a chain: exactly one of its members has a value.
struct Filter {
  std::optional<VoxelFilter> voxel;
  std::optional<OutlierFilter> outlier;
  std::optional<CropFilter> crop;
  std::optional<PlaneFilter> plane;
  static Parameters<Filter> parameters();
};

struct Options {
  std::filesystem::path path;
  std::optional<std::filesystem::path> poses;
  std::string match = "order";
  double max_pose_offset_s = 0.01;
  std::string points_in = "optical";
  int first_frame = 0;
  int max_frames = 0;
  int stride = 1;
  double rate_hz = 30.0;
  std::vector<Filter> filters;
  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// Opens a file or folder of point clouds. Fails with kNotFound where there is none, kConfig where
/// the options or the file of poses are wrong. `seed` decides what the plane filter tries; `log`,
/// which outlives the source, is told what was read.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            std::uint64_t seed, Log& log);

}  // namespace sidestep::pcd
