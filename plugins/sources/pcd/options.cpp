#include "options.hpp"

namespace sidestep::pcd {

Parameters<VoxelFilter> VoxelFilter::parameters() {
  return Parameters<VoxelFilter>().add("leaf_m", &VoxelFilter::leaf_m, "Edge of the cube.",
                                       {.unit = "m", .min = 1e-4});
}

Parameters<OutlierFilter> OutlierFilter::parameters() {
  using F = OutlierFilter;
  return Parameters<F>()
      .add("neighbours", &F::neighbours, "How many nearest points are looked at.", {.min = 1})
      .add("deviations", &F::deviations,
           "A point is dropped when its mean distance to them exceeds the mean of all points by "
           "this many standard deviations.",
           {.min = 0.0});
}

Parameters<CropFilter> CropFilter::parameters() {
  using F = CropFilter;
  return Parameters<F>()
      .add("min_m", &F::min_m, "Lower corner of the box.", {.unit = "m", .required = true})
      .add("max_m", &F::max_m, "Upper corner of the box.", {.unit = "m", .required = true})
      .add("frame", &F::frame, "Frame of the box; camera: the optical frame.",
           {.choices = {"world", "camera"}})
      .add("keep", &F::keep, "Which points stay.", {.choices = {"inside", "outside"}});
}

Parameters<PlaneFilter> PlaneFilter::parameters() {
  using F = PlaneFilter;
  return Parameters<F>()
      .add("distance_m", &F::distance_m, "Points this near to the plane belong to it.",
           {.unit = "m", .min = 1e-5})
      .add("min_share", &F::min_share,
           "A plane with a smaller share of the points is left in the cloud.",
           {.min = 0.0, .max = 1.0})
      .add("iterations", &F::iterations, "Planes tried at most.", {.min = 1});
}

Parameters<Filter> Filter::parameters() {
  return Parameters<Filter>()
      .add("voxel", &Filter::voxel, "One point, the mean, for all points in a cube.")
      .add("outlier", &Filter::outlier, "Drops points whose neighbours are far away.")
      .add("crop", &Filter::crop, "Keeps the points in a box, or those outside.")
      .add("plane", &Filter::plane, "Removes the points of the largest plane.");
}

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("path", &O::path, "A .pcd file, or a folder of them, taken in the order of their names.",
           {.required = true})
      .add("poses", &O::poses,
           "File of poses of the sensor, 'stamp tx ty tz qx qy qz qw' a line; null: each file's "
           "VIEWPOINT.")
      .add("match", &O::match,
           "Which line of poses is whose; order: one line a file, in order; stamp: the nearest to "
           "the file's name, read as seconds.",
           {.choices = {"order", "stamp"}})
      .add("max_pose_offset_s", &O::max_pose_offset_s,
           "With match stamp, how far the nearest pose may be from the file.",
           {.unit = "s", .min = 0.0})
      .add("points_in", &O::points_in,
           "Frame of the points; optical: sensor, z forward; forward: sensor, x forward and z up; "
           "world: already placed in the world. Poses are of the sensor's frame with these axes; "
           "for world, of the optical one.",
           {.choices = {"optical", "forward", "world"}})
      .add("first_frame", &O::first_frame, "Files left out at the beginning.", {.min = 0})
      .add("max_frames", &O::max_frames, "Frames handed out at most; 0: all.", {.min = 0})
      .add("stride", &O::stride, "Every how many files one is handed out.", {.min = 1})
      .add("rate_hz", &O::rate_hz, "Frames a second, for stamps where poses give none.",
           {.unit = "Hz", .min = 1e-3})
      .add("filters", &O::filters,
           "Applied to each cloud in this order; each item has one key, the filter's name.");
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  for (std::size_t i = 0; i < filters.size(); ++i) {
    const Filter& filter = filters[i];
    const std::string name = "filters[" + std::to_string(i) + "]";
    const int count = (filter.voxel ? 1 : 0) + (filter.outlier ? 1 : 0) + (filter.crop ? 1 : 0) +
                      (filter.plane ? 1 : 0);
    if (count != 1) {
      mistakes.push_back({{name},
                          "names " + std::to_string(count) + " filters, expected one",
                          "write one item a filter: - voxel: {leaf_m: 0.02}"});
    }
    if (filter.crop && !(filter.crop->min_m.array() < filter.crop->max_m.array()).all()) {
      mistakes.push_back({{name + ".crop.min_m"}, "must be below max_m along each axis", {}});
    }
  }
  if (match == "stamp" && !poses) {
    mistakes.push_back({{"match"}, "is stamp, but poses is not set", {}});
  }
  return mistakes;
}

}  // namespace sidestep::pcd
