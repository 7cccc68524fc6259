#include "cloud_filters.hpp"

#include <pcl/filters/crop_box.h>
#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>

#include <cmath>
#include <limits>
#include <string>

namespace sidestep::pcd {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

Cloud::Ptr to_pcl(const std::vector<Eigen::Vector3f>& points) {
  auto cloud = pcl::make_shared<Cloud>();
  cloud->reserve(points.size());
  for (const Eigen::Vector3f& p : points) cloud->emplace_back(p.x(), p.y(), p.z());
  return cloud;
}

std::vector<Eigen::Vector3f> from_pcl(const Cloud& cloud) {
  std::vector<Eigen::Vector3f> points;
  points.reserve(cloud.size());
  for (const pcl::PointXYZ& p : cloud) points.emplace_back(p.x, p.y, p.z);
  return points;
}

Result<Cloud::Ptr> filtered(const VoxelFilter& options, const Cloud::Ptr& cloud) {
  Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array3d high = -low;
  for (const pcl::PointXYZ& p : *cloud) {
    low = low.min(p.getArray3fMap().cast<double>());
    high = high.max(p.getArray3fMap().cast<double>());
  }
  // Where its index of 32 bits would overflow, PCL warns on stderr and changes nothing.
  const double cubes = ((high - low) / options.leaf_m + 2.0).prod();
  if (cubes > std::numeric_limits<std::int32_t>::max()) {
    const Eigen::Array3d extent_m = high - low;
    return fail(ErrorCode::kBadFrame,
                "voxel: leaf_m is too small for a cloud of " + std::to_string(extent_m.x()) +
                    " x " + std::to_string(extent_m.y()) + " x " + std::to_string(extent_m.z()) +
                    " m",
                {}, "crop the cloud first, or choose a larger leaf_m");
  }
  pcl::VoxelGrid<pcl::PointXYZ> filter;
  const auto leaf_m = static_cast<float>(options.leaf_m);
  filter.setLeafSize(leaf_m, leaf_m, leaf_m);
  filter.setInputCloud(cloud);
  auto kept = pcl::make_shared<Cloud>();
  filter.filter(*kept);
  return kept;
}

Result<Cloud::Ptr> filtered(const OutlierFilter& options, const Cloud::Ptr& cloud) {
  if (cloud->size() <= static_cast<std::size_t>(options.neighbours)) {
    return fail(ErrorCode::kBadFrame, "outlier: a cloud of " + std::to_string(cloud->size()) +
                                          " points has no " + std::to_string(options.neighbours) +
                                          " neighbours for each");
  }
  pcl::StatisticalOutlierRemoval<pcl::PointXYZ> filter;
  filter.setMeanK(options.neighbours);
  filter.setStddevMulThresh(options.deviations);
  filter.setInputCloud(cloud);
  auto kept = pcl::make_shared<Cloud>();
  filter.filter(*kept);
  return kept;
}

Result<Cloud::Ptr> filtered(const CropFilter& options, const Cloud::Ptr& cloud,
                            const Transform& T_world_camera) {
  pcl::CropBox<pcl::PointXYZ> filter;
  const Eigen::Vector3f min_m = options.min_m.cast<float>();
  const Eigen::Vector3f max_m = options.max_m.cast<float>();
  filter.setMin(min_m.homogeneous());
  filter.setMax(max_m.homogeneous());
  filter.setNegative(options.keep == "outside");
  if (options.frame == "world") {
    filter.setTransform(Eigen::Affine3f(T_world_camera.cast<float>()));
  }
  filter.setInputCloud(cloud);
  auto kept = pcl::make_shared<Cloud>();
  filter.filter(*kept);
  return kept;
}

/// PCL offers a fixed seed or the time of day.
class SeededPlane final : public pcl::SampleConsensusModelPlane<pcl::PointXYZ> {
 public:
  SeededPlane(const Cloud::Ptr& cloud, std::uint64_t seed) : SampleConsensusModelPlane(cloud) {
    rng_alg_.seed(static_cast<std::uint32_t>(seed ^ (seed >> 32)));
  }
};

Result<Cloud::Ptr> filtered(const PlaneFilter& options, const Cloud::Ptr& cloud,
                            std::uint64_t seed) {
  constexpr std::size_t kPointsOfAPlane = 3;
  if (cloud->size() < kPointsOfAPlane) return cloud;
  const auto model = pcl::make_shared<SeededPlane>(cloud, seed);
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, options.distance_m);
  ransac.setMaxIterations(options.iterations);
  if (!ransac.computeModel()) return cloud;
  pcl::Indices inliers;
  ransac.getInliers(inliers);
  Eigen::VectorXf tried, refined;
  ransac.getModelCoefficients(tried);
  model->optimizeModelCoefficients(inliers, tried, refined);
  model->selectWithinDistance(refined, options.distance_m, inliers);
  const double share = static_cast<double>(inliers.size()) / static_cast<double>(cloud->size());
  if (share < options.min_share) return cloud;
  auto kept = pcl::make_shared<Cloud>();
  auto inlier = inliers.begin();  // ascending
  for (std::size_t i = 0; i < cloud->size(); ++i) {
    if (inlier != inliers.end() && static_cast<std::size_t>(*inlier) == i) {
      ++inlier;
    } else {
      kept->push_back((*cloud)[i]);
    }
  }
  return kept;
}

}  // namespace

Result<std::vector<Eigen::Vector3f>> apply_filters(const std::vector<Filter>& filters,
                                                   std::vector<Eigen::Vector3f> points_m,
                                                   const Transform& T_world_camera,
                                                   std::uint64_t seed) {
  if (filters.empty()) return points_m;
  Cloud::Ptr cloud = to_pcl(points_m);
  for (std::size_t i = 0; i < filters.size(); ++i) {
    const Filter& filter = filters[i];
    auto kept = filter.voxel     ? filtered(*filter.voxel, cloud)
                : filter.outlier ? filtered(*filter.outlier, cloud)
                : filter.crop    ? filtered(*filter.crop, cloud, T_world_camera)
                                 : filtered(*filter.plane, cloud, seed + i);
    const std::string name = "source.filters[" + std::to_string(i) + "]";
    if (!kept) {
      Error error = std::move(kept.error());
      error.message = name + "." + error.message;
      return tl::make_unexpected(std::move(error));
    }
    if ((*kept)->empty()) {
      return fail(ErrorCode::kBadFrame,
                  name + " left none of " + std::to_string(cloud->size()) + " points");
    }
    cloud = *kept;
  }
  return from_pcl(*cloud);
}

}  // namespace sidestep::pcd
