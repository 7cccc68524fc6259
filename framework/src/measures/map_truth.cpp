#include <sidestep/measures/map_truth.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace sidestep {
namespace {

/// Fewer rays on an object do not count as seeing it.
constexpr std::int64_t kRaysInView = 10;
/// An object has appeared when the map has this share of what is seen of it.
constexpr double kAppearedShare = 0.5;

Eigen::Vector3i voxel_of(const GridSpec& grid, std::size_t linear) {
  const auto nx = static_cast<std::size_t>(grid.size_vox.x());
  const auto ny = static_cast<std::size_t>(grid.size_vox.y());
  return {static_cast<int>(linear % nx), static_cast<int>(linear / nx % ny),
          static_cast<int>(linear / nx / ny)};
}

/// Half the edges of a box around a shape in its own frame.
Eigen::Vector3d half_extent_m(const Shape& shape) {
  constexpr double kEndless_m = 1e6;
  if (std::holds_alternative<HalfSpace>(shape)) return Eigen::Vector3d::Constant(kEndless_m);
  Eigen::Vector3d half = Eigen::Vector3d::Zero();
  const auto include = [&](const Mesh& mesh) {
    for (const Eigen::Vector3d& vertex : mesh.vertices_m) half = half.cwiseMax(vertex.cwiseAbs());
  };
  if (const auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape)) {
    include(**mesh);
  } else {
    include(triangulate(shape));
  }
  return 1.05 * half;  // facets are inscribed
}

bool measured(float depth_m) { return std::isfinite(depth_m) && depth_m > 0.0F; }

}  // namespace

Parameters<TruthSettings> TruthSettings::parameters() {
  using T = TruthSettings;
  return Parameters<T>()
      .add("measure", &T::measure, "Whether maps are held against the scene, where it is known.")
      .add("pixel_stride", &T::pixel_stride,
           "Every n-th pixel of every n-th row tells which surfaces were seen.",
           {.unit = "px", .min = 1, .max = 256})
      .add("min_z_m", &T::min_z_m, "Lower surfaces are left out: mappers do not insert the floor.",
           {.unit = "m"})
      .add("max_range_m", &T::max_range_m,
           "Farther surfaces are left out; not more than the mappers' own range.",
           {.unit = "m", .min = 0.1});
}

MapTruth::MapTruth(const Scene& scene, const GridSpec& grid, const TruthSettings& settings)
    : scene_(scene),
      grid_(grid),
      settings_(settings),
      near_m_(std::sqrt(3.0) * grid.resolution_m),
      caster_(scene),
      surface_(grid.voxel_count()),
      swept_(grid.voxel_count()) {
  for (std::size_t i = 0; i < scene.objects().size(); ++i) {
    const SceneObject& object = scene.objects()[i];
    if (object.moves()) movers_.push_back({i, half_extent_m(object.shape)});
  }
}

void MapTruth::observe(const Frame& frame, const OccupancyView& map) {
  time_s_ = frame.stamp.seconds();
  caster_.set_time(time_s_);
  look(frame);
  see_surfaces();
  follow_movers(map);
  sweep_movers(time_s_);
  follow_leavings(frame, map);
}

void MapTruth::look(const Frame& frame) {
  sight_.origins.clear();
  sight_.directions.clear();
  const auto add = [&](const Eigen::Vector3d& p_camera) {
    sight_.origins.emplace_back(frame.T_world_camera.translation());
    sight_.directions.emplace_back((frame.T_world_camera.linear() * p_camera).normalized());
  };
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    for (int v = 0; v < image->camera.height_px; v += settings_.pixel_stride) {
      for (int u = 0; u < image->camera.width_px; u += settings_.pixel_stride) {
        if (measured(image->at(u, v))) add(image->camera.unproject(u, v, 1.0));
      }
    }
  } else {
    const auto& points = std::get<PointCloud>(frame.measurement).points_m;
    const auto step = static_cast<std::size_t>(settings_.pixel_stride) *
                      static_cast<std::size_t>(settings_.pixel_stride);
    for (std::size_t i = 0; i < points.size(); i += step) {
      if (points[i].allFinite() && points[i].norm() > 0.0F) add(points[i].cast<double>());
    }
  }
  sight_.hits.resize(sight_.origins.size());
  caster_.cast(sight_.origins, sight_.directions, sight_.hits);
}

void MapTruth::see_surfaces() {
  for (std::size_t i = 0; i < sight_.hits.size(); ++i) {
    const RayHit& hit = sight_.hits[i];
    if (hit.object < 0 || hit.distance_m > settings_.max_range_m) continue;
    if (scene_.objects()[static_cast<std::size_t>(hit.object)].moves()) continue;
    const Eigen::Vector3d p_world = sight_.origins[i] + hit.distance_m * sight_.directions[i];
    const Eigen::Vector3i voxel = grid_.voxel_at(p_world);
    if (p_world.z() >= settings_.min_z_m && grid_.contains(voxel)) {
      surface_[grid_.linear(voxel)] = true;
    }
  }
}

void MapTruth::follow_movers(const OccupancyView& map) {
  for (Mover& mover : movers_) {
    std::int64_t rays = 0, found = 0;
    for (std::size_t i = 0; i < sight_.hits.size(); ++i) {
      const RayHit& hit = sight_.hits[i];
      if (hit.object != static_cast<int>(mover.object) || hit.distance_m > settings_.max_range_m) {
        continue;
      }
      const Eigen::Vector3d p_world = sight_.origins[i] + hit.distance_m * sight_.directions[i];
      const Eigen::Vector3i voxel = grid_.voxel_at(p_world);
      if (p_world.z() < settings_.min_z_m || !grid_.contains(voxel)) continue;
      ++rays;
      found += has_occupied_near(map, voxel) ? 1 : 0;
    }
    if (rays < kRaysInView) {
      if (mover.in_view && !mover.has_appeared) ++record_.never_appeared;
      mover.in_view = mover.has_appeared = false;
      mover.frames_in_view = 0;
      continue;
    }
    mover.in_view = true;
    ++mover.frames_in_view;
    if (!mover.has_appeared &&
        static_cast<double>(found) >= kAppearedShare * static_cast<double>(rays)) {
      mover.has_appeared = true;
      record_.appear_frames.push_back(mover.frames_in_view);
    }
  }
}

void MapTruth::sweep_movers(double time_s) {
  for (const Mover& mover : movers_) {
    const SceneObject& object = scene_.objects()[mover.object];
    const Transform T_world_object = object.T_world_object(time_s);
    const Transform T_object_world = T_world_object.inverse();
    const Eigen::Vector3d reach = T_world_object.linear().cwiseAbs() * mover.half_extent_m +
                                  Eigen::Vector3d::Constant(near_m_);
    const Eigen::Vector3d centre = T_world_object.translation();
    const auto clamped = [&](const Eigen::Vector3d& p_world) -> Eigen::Vector3i {
      const Eigen::Vector3d inside = p_world.cwiseMax(grid_.origin_m).cwiseMin(grid_.upper_m());
      return grid_.voxel_at(inside).cwiseMax(0).cwiseMin((grid_.size_vox.array() - 1).matrix());
    };
    const Eigen::Vector3i low = clamped(centre - reach);
    const Eigen::Vector3i high = clamped(centre + reach);
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          const std::size_t linear = grid_.linear({x, y, z});
          if (swept_[linear]) continue;
          const Eigen::Vector3d p_object = T_object_world * grid_.centre_m({x, y, z});
          if (signed_distance_m(object.shape, p_object) > near_m_) continue;
          swept_[linear] = true;
          swept_list_.push_back(linear);
        }
      }
    }
  }
}

void MapTruth::follow_leavings(const Frame& frame, const OccupancyView& map) {
  const VoxelBits occupied = map.occupied();
  for (const std::size_t linear : swept_list_) {
    const Eigen::Vector3i voxel = voxel_of(grid_, linear);
    const bool is_occupied = occupied.at(grid_, voxel);
    const auto known = leaving_.find(linear);
    if (!is_occupied && known == leaving_.end()) continue;
    const Eigen::Vector3d centre_m = grid_.centre_m(voxel);
    if (scene_.signed_distance(centre_m, time_s_).distance_m <= near_m_) {
      // Rightly occupied, and to be freed once the object has left.
      if (is_occupied) {
        leaving_[linear] = 0;
      } else {
        leaving_.erase(known);
      }
    } else if (known != leaving_.end()) {
      known->second += seen_through(frame, centre_m) ? 1 : 0;
      if (is_occupied) continue;
      record_.gone_frames.push_back(known->second);
      leaving_.erase(known);
    }
  }
}

bool MapTruth::seen_through(const Frame& frame, const Eigen::Vector3d& centre_m) const {
  const Eigen::Vector3d p_camera = frame.T_world_camera.inverse() * centre_m;
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr || p_camera.z() <= 0.0) return false;
  const CameraIntrinsics& camera = image->camera;
  const auto u =
      static_cast<int>(std::lround(camera.fx_px * p_camera.x() / p_camera.z() + camera.cx_px));
  const auto v =
      static_cast<int>(std::lround(camera.fy_px * p_camera.y() / p_camera.z() + camera.cy_px));
  if (u < 0 || v < 0 || u >= camera.width_px || v >= camera.height_px) return false;
  if (!measured(image->at(u, v))) return false;
  const Eigen::Vector3d origin = frame.T_world_camera.translation();
  const double distance_m = (centre_m - origin).norm();
  const std::array<Eigen::Vector3d, 1> origins = {origin};
  const std::array<Eigen::Vector3d, 1> directions = {(centre_m - origin) / distance_m};
  std::array<RayHit, 1> hits;
  caster_.cast(origins, directions, hits);
  return hits[0].object >= 0 && hits[0].distance_m > distance_m + near_m_ &&
         image->at(u, v) > p_camera.z() + near_m_ && distance_m < settings_.max_range_m;
}

bool MapTruth::has_occupied_near(const OccupancyView& map, const Eigen::Vector3i& voxel) const {
  const VoxelBits occupied = map.occupied();
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const Eigen::Vector3i near = voxel + Eigen::Vector3i(dx, dy, dz);
        if (grid_.contains(near) && occupied.at(grid_, near)) return true;
      }
    }
  }
  return false;
}

std::vector<std::size_t> MapTruth::in_view() const {
  std::vector<std::size_t> objects;
  for (const Mover& mover : movers_) {
    if (mover.in_view) objects.push_back(mover.object);
  }
  return objects;
}

TruthRecord MapTruth::finish(const OccupancyView& map) const {
  TruthRecord record = record_;
  const VoxelBits occupied = map.occupied();
  for (std::size_t linear = 0; linear < surface_.size(); ++linear) {
    const Eigen::Vector3i voxel = voxel_of(grid_, linear);
    if (surface_[linear]) {
      ++record.surface_vox;
      record.surface_found_vox += has_occupied_near(map, voxel) ? 1 : 0;
    }
    if (!occupied.at(grid_, voxel)) continue;
    ++record.occupied_vox;
    const double distance_m = scene_.signed_distance(grid_.centre_m(voxel), time_s_).distance_m;
    record.false_vox += distance_m > near_m_ ? 1 : 0;
  }
  for (const auto& [linear, seen] : leaving_) {
    const Eigen::Vector3d centre_m = grid_.centre_m(voxel_of(grid_, linear));
    if (scene_.signed_distance(centre_m, time_s_).distance_m <= near_m_) continue;
    ++record.ghost_vox;
    record.ghost_seen_vox += seen > 0 ? 1 : 0;
  }
  for (const Mover& mover : movers_) record.never_appeared += mover.in_view && !mover.has_appeared;
  return record;
}

}  // namespace sidestep
