// Distance fields.
#include <algorithm>
#include <array>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

struct FieldQuery {
  py::array_t<double> distances_m, gradients;
  py::array_t<std::uint8_t> statuses;
};

FieldQuery query(const DistanceField& field, const Doubles& points_m, bool wants_all) {
  const py::ssize_t n = rows_of(points_m, 3, "points_m");
  const auto count = static_cast<std::size_t>(n);
  FieldQuery result{py::array_t<double>(n), py::array_t<double>({n, py::ssize_t{3}}),
                    py::array_t<std::uint8_t>(n)};
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double) && sizeof(FieldStatus) == 1);
  const std::span points(reinterpret_cast<const Eigen::Vector3d*>(points_m.data()), count);
  const std::span gradients(reinterpret_cast<Eigen::Vector3d*>(result.gradients.mutable_data()),
                            wants_all ? count : 0);
  const std::span statuses(reinterpret_cast<FieldStatus*>(result.statuses.mutable_data()),
                           wants_all ? count : 0);
  const std::span distances(result.distances_m.mutable_data(), count);
  const Unlocked release;
  field.query(points, distances, gradients, statuses);
  return result;
}

/// A block's values, z, y and x as in memory turned to x, y and z, cut off at the grid's end.
py::array block(const py::object& self, int i, int j, int k) {
  const DenseField& field = dense(self.cast<const DistanceField&>());
  const Eigen::Vector3i at(i, j, k), counts = block_counts(field.info().grid);
  if ((at.array() < 0).any() || (at.array() >= counts.array()).any()) {
    throw py::index_error("the field has " + std::to_string(counts.x()) + " x " +
                          std::to_string(counts.y()) + " x " + std::to_string(counts.z()) +
                          " blocks");
  }
  const Eigen::Vector3i size =
      (field.info().grid.size_vox - kBlockSide_vox * at).cwiseMin(kBlockSide_vox);
  const auto& values =
      field.blocks().block(static_cast<std::size_t>(block_linear(at, counts))).distance_m;
  constexpr py::ssize_t kX = sizeof(float), kY = kX * kBlockSide_vox, kZ = kY * kBlockSide_vox;
  py::array view(py::dtype::of<float>(), {size.x(), size.y(), size.z()}, {kX, kY, kZ},
                 values.data(), self);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}

py::array_t<float> distances(const DistanceField& self) {
  const DenseField& field = dense(self);
  const GridSpec& grid = field.info().grid;
  const Eigen::Vector3i size = grid.size_vox, counts = block_counts(grid);
  py::array_t<float, py::array::f_style> result({size.x(), size.y(), size.z()});
  float* into = result.mutable_data();
  const Unlocked release;
  for (int k = 0; k < size.z(); ++k) {
    for (int j = 0; j < size.y(); ++j) {
      for (int b = 0; b < counts.x(); ++b) {
        const auto& values = field.blocks()
                                 .block(static_cast<std::size_t>(block_linear(
                                     {b, j / kBlockSide_vox, k / kBlockSide_vox}, counts)))
                                 .distance_m;
        const int row =
            kBlockSide_vox * (j % kBlockSide_vox + kBlockSide_vox * (k % kBlockSide_vox));
        const int count = std::min(kBlockSide_vox, size.x() - kBlockSide_vox * b);
        into = std::copy_n(values.data() + row, count, into);
      }
    }
  }
  return result;
}

}  // namespace

const DenseField& dense(const DistanceField& field) {
  const auto* blocks = dynamic_cast<const DenseField*>(&field);
  if (blocks != nullptr) return *blocks;
  raise({ErrorCode::kUnsupported, "this field has no voxels", {}, {}, nullptr});
}

void bind_fields(py::module_& module) {
  py::class_<GridSpec>(module, "Grid",
                       "Cubic voxels; voxel (i, j, k) has its centre at origin_m + (i + 0.5, j + "
                       "0.5, k + 0.5) * resolution_m.")
      .def_readonly("origin_m", &GridSpec::origin_m,
                    "Its lower corner: 3 values in m, world frame.")
      .def_readonly("resolution_m", &GridSpec::resolution_m, "Edge of a voxel, in m.")
      .def_property_readonly(
          "size_vox",
          [](const GridSpec& grid) {
            return std::array{grid.size_vox.x(), grid.size_vox.y(), grid.size_vox.z()};
          },
          "Voxels along x, y and z.");

  py::class_<DistanceField, std::shared_ptr<DistanceField>>(
      module, "DistanceField",
      "The distance to the nearest obstacle, as one snapshot that never changes.")
      .def(
          "distance",
          [](const DistanceField& f, const Doubles& p) { return query(f, p, false).distances_m; },
          py::arg("points_m"), "Of n x 3 points in m, world frame: n, in m.")
      .def(
          "query",
          [](const DistanceField& f, const Doubles& p) {
            FieldQuery all = query(f, p, true);
            return py::make_tuple(all.distances_m, all.gradients, all.statuses);
          },
          py::arg("points_m"),
          "Of n x 3 points in m, world frame: distances (n, m), gradients (n x 3, world frame) and "
          "statuses (n: KNOWN, UNKNOWN or OUTSIDE).")
      .def_property_readonly(
          "grid", [](const DistanceField& f) { return f.info().grid; },
          "Its voxels; of an exact field but its bounds.")
      .def_property_readonly(
          "sequence", [](const DistanceField& f) { return f.info().sequence; },
          "Updates that went into it.")
      .def_property_readonly(
          "stamp_s", [](const DistanceField& f) { return f.info().stamp.seconds(); },
          "Of the newest frame in it, in s.")
      .def_property_readonly(
          "max_distance_m", [](const DistanceField& f) { return f.info().max_distance_m; },
          "Distances are cut off here, in m; inf where they are not.")
      .def_property_readonly(
          "block_counts",
          [](const DistanceField& f) {
            const Eigen::Vector3i n = block_counts(dense(f).info().grid);
            return std::array{n.x(), n.y(), n.z()};
          },
          "Blocks of 16 x 16 x 16 voxels along each axis.")
      .def("block", &block, py::arg("i"), py::arg("j"), py::arg("k"),
           "Distances in m at the centres of a block's voxels, x, y, z: a view that cannot be "
           "written and keeps "
           "the field. Fields share the blocks that did not change.")
      .def("distances", &distances,
           "Distances at the centres of all voxels, nx x ny x nz, float32: a copy, of 4 bytes a "
           "voxel.");
  module.attr("KNOWN") = static_cast<int>(FieldStatus::kKnown);
  module.attr("UNKNOWN") = static_cast<int>(FieldStatus::kUnknown);
  module.attr("OUTSIDE") = static_cast<int>(FieldStatus::kOutside);
}

}  // namespace sidestep::python
