// From frames to maps and distance fields.
#include <array>
#include <filesystem>
#include <mutex>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/geometry/load_scene.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/yaml_document.hpp>
#include <sidestep/sensing/source.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

Transform transform_of(const Eigen::Matrix4d& matrix, const char* what) {
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  constexpr double kTolerance = 1e-6;
  if (!matrix.allFinite() || !rotation.isUnitary(kTolerance) || rotation.determinant() < 0.0 ||
      !matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1))) {
    throw py::value_error(std::string(what) + " has to be a rotation and a translation, 4 x 4");
  }
  Transform transform;
  transform.matrix() = matrix;
  return transform;
}

Frame make_frame(const py::array_t<float, py::array::c_style | py::array::forcecast>& depth_m,
                 const CameraIntrinsics& camera, const Eigen::Matrix4d& T_world_camera,
                 double stamp_s, const std::optional<Eigen::VectorXd>& joint_positions) {
  if (depth_m.ndim() != 2 || depth_m.shape(0) != camera.height_px ||
      depth_m.shape(1) != camera.width_px) {
    throw py::value_error("depth_m has to be " + std::to_string(camera.height_px) + " x " +
                          std::to_string(camera.width_px) + ", rows of the camera's image");
  }
  Frame frame;
  frame.stamp = Stamp::from_seconds(stamp_s);
  frame.T_world_camera = transform_of(T_world_camera, "T_world_camera");
  frame.measurement =
      DepthImage{camera, std::vector<float>(depth_m.data(), depth_m.data() + depth_m.size())};
  frame.joint_positions = joint_positions;
  return frame;
}

py::object depth_of(const py::object& self) {
  const auto* image = std::get_if<DepthImage>(&self.cast<const Frame&>().measurement);
  if (image == nullptr) return py::none();
  return view_of<float>({image->camera.height_px, image->camera.width_px}, image->depth_m.data(),
                        self);
}

py::object points_of(const py::object& self) {
  const auto* cloud = std::get_if<PointCloud>(&self.cast<const Frame&>().measurement);
  if (cloud == nullptr) return py::none();
  return view_of<float>({static_cast<py::ssize_t>(cloud->points_m.size()), 3},
                        cloud->points_m.empty() ? nullptr : cloud->points_m.front().data(), self);
}

constexpr double kPatience_s = 0.1;  ///< Before Ctrl-C is looked for.

/// A source as an iterator: frames that cannot be used are passed over, and kept as errors.
struct Frames {
  explicit Frames(std::shared_ptr<Source> its) : source(std::move(its)) {}

  std::shared_ptr<Source> source;
  std::mutex mutex = {};  ///< Of the source; to be locked without Python's lock, as the others are.
  py::list bad_frames = py::list();

  std::shared_ptr<Frame> next() {
    for (;;) {
      auto frame = [&] {
        const py::gil_scoped_release release;
        const std::scoped_lock lock(mutex);
        return catch_all("source", [&] { return source->next(Deadline::after_s(kPatience_s)); });
      }();
      if (!frame && frame.error().code == ErrorCode::kDeadlineExceeded) {
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        continue;
      }
      if (!frame && frame.error().code == ErrorCode::kBadFrame) {
        bad_frames.append(exception_of(frame.error()));
        continue;
      }
      auto got = need(std::move(frame));
      if (!got) throw py::stop_iteration();
      return std::make_shared<Frame>(std::move(*got));
    }
  }
};

/// The frame that Python has.
class GivenFrame final : public Source {
 public:
  void give(const Frame& frame) noexcept { frame_ = &frame; }

  Result<std::optional<Frame>> next(const Deadline&) override {
    const Frame* const frame = std::exchange(frame_, nullptr);
    return frame != nullptr ? std::optional(*frame) : std::nullopt;
  }
  std::optional<std::int64_t> frame_count() const override { return std::nullopt; }

 private:
  const Frame* frame_ = nullptr;
};

/// Keeps why the field is not built as it was asked for.
class KeptLog final : public Log {
 public:
  void write(LogLevel level, std::string_view message) override {
    if (level >= LogLevel::kWarning && first.empty()) first = message;
  }
  std::string first;
};

/// What is done about what moves; each does what those before it do.
enum class Motion { kIgnored, kDetected, kTracked, kApart };

Motion motion_of(const std::string& name) {
  constexpr std::array kNames{"ignored", "detected", "tracked", "apart"};
  const auto found = std::ranges::find(kNames, name);
  if (found != kNames.end()) return static_cast<Motion>(found - kNames.begin());
  throw py::value_error("motion has to be \"ignored\", \"detected\", \"tracked\" or \"apart\"");
}

/// A mapper and the field that is made of it.
struct Map {
  Map(SessionPtr its, const RobotPtr& robot, PluginPtr<Mapper> maps, PluginPtr<FieldBuilder> builds,
      Motion asked)
      : session(std::move(its)),
        mapper(std::move(maps)),
        builder(std::move(builds)),
        motion(asked),
        tracker({}, robot),
        pipeline({.source = given,
                  .mapper = *mapper,
                  .field_builder = *builder,
                  .slot = slot,
                  .log = log,
                  .names = {"source", plugin_of(mapper), plugin_of(builder)},
                  .motion_detector = motion >= Motion::kDetected ? &detector : nullptr,
                  .tracker = motion >= Motion::kTracked ? &tracker : nullptr,
                  .masks_tracks = motion == Motion::kApart}) {}

  SessionPtr session;
  PluginPtr<Mapper> mapper;
  PluginPtr<FieldBuilder> builder;
  Motion motion;
  GivenFrame given = {};
  KeptLog log = {};
  SnapshotSlot slot = {};
  MotionDetector detector = MotionDetector();
  Tracker tracker;
  MappingPipeline pipeline;
  std::mutex mutex = {};

  Result<void> attach() {
    if (motion != Motion::kIgnored && dynamic_cast<OccupancyView*>(mapper.get()) == nullptr) {
      return fail(ErrorCode::kUnsupported, "it does not tell occupancy, which motion needs",
                  plugin_of(mapper));
    }
    SIDESTEP_TRY(pipeline.attach());
    if (log.first.empty()) return {};
    return fail(ErrorCode::kUnsupported, log.first);
  }
  Result<std::shared_ptr<const DistanceField>> integrate(const Frame& frame) {
    const std::scoped_lock lock(mutex);
    given.give(frame);
    const auto step = SIDESTEP_TRY(pipeline.step(Deadline()));
    if (!step) return tl::make_unexpected(pipeline.take_bad_frames().back());
    return slot.pin();
  }
  [[nodiscard]] SnapshotPtr snapshot() const {
    MapSnapshot newest = slot.snapshot();
    if (!newest.field) return nullptr;
    return std::make_shared<Snapshot>(Snapshot{std::move(newest), motion == Motion::kApart});
  }
  [[nodiscard]] const OccupancyView& occupancy() const {
    const auto* view = dynamic_cast<const OccupancyView*>(mapper.get());
    if (view != nullptr) return *view;
    raise({ErrorCode::kUnsupported, "it does not tell occupancy", plugin_of(mapper), {}, nullptr});
  }
};

std::shared_ptr<Map> make_map(const SessionPtr& session, const py::object& mapper,
                              const py::object& field, const RobotPtr& robot,
                              const std::string& motion) {
  const Node mapper_block = block_of(mapper, "mapper"), field_block = block_of(field, "field");
  const Motion about_motion = motion_of(motion);
  return unlocked("map", [&]() -> Result<std::shared_ptr<Map>> {
    auto made = SIDESTEP_TRY(session->host().create<Mapper>(mapper_block, robot));
    auto builder = SIDESTEP_TRY(session->host().create<FieldBuilder>(field_block, robot));
    auto map =
        std::make_shared<Map>(session, robot, std::move(made), std::move(builder), about_motion);
    SIDESTEP_TRY(map->attach());
    return map;
  });
}

/// nx x ny x nz, of one bit a voxel: the occupied ones, or those known.
py::array_t<bool> bits_of(Map& map, VoxelBits (OccupancyView::*which)() const noexcept) {
  const OccupancyView& view = map.occupancy();
  const Eigen::Vector3i size = view.occupancy_grid().size_vox;
  py::array_t<bool> result({size.x(), size.y(), size.z()});
  auto into = result.mutable_unchecked<3>();
  const py::gil_scoped_release release;
  const std::scoped_lock lock(map.mutex);
  const VoxelBits bits = (view.*which)();
  for (int k = 0; k < size.z(); ++k) {
    for (int j = 0; j < size.y(); ++j) {
      for (int i = 0; i < size.x(); ++i) into(i, j, k) = bits.at(view.occupancy_grid(), {i, j, k});
    }
  }
  return result;
}

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
  const py::gil_scoped_release release;
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
  const py::gil_scoped_release release;
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

Scene make_scene(const SessionPtr& session, const py::object& value,
                 std::optional<std::uint64_t> seed) {
  Scene scene;
  if (py::isinstance<py::dict>(value)) {
    SceneReading reading = read_scene(node_of(value, "scene"));
    if (!reading.errors.empty()) raise(reading.errors.front());
    scene = std::move(reading.scene);
  } else if (!py::isinstance<py::str>(value) && !py::hasattr(value, "__fspath__")) {
    throw py::type_error("a scene is a name, a file or a dict");
  } else {
    scene = need(load_scene(value.cast<std::filesystem::path>(),
                            {install_layout().configs / "scenes"}, session->documents()));
  }
  return seed ? need(scene.drawn(*seed)) : scene;
}

std::shared_ptr<DistanceField> scene_field(const Scene& scene, const Eigen::Vector3d& lower_m,
                                           const Eigen::Vector3d& upper_m, double time_s) {
  if (!(lower_m.array() < upper_m.array()).all()) {
    throw py::value_error("lower_m has to be below upper_m along each axis");
  }
  return std::make_shared<SceneField>(scene, Stamp::from_seconds(time_s),
                                      Eigen::AlignedBox3d(lower_m, upper_m));
}

}  // namespace

const DenseField& dense(const DistanceField& field) {
  const auto* blocks = dynamic_cast<const DenseField*>(&field);
  if (blocks != nullptr) return *blocks;
  raise({ErrorCode::kUnsupported, "this field has no voxels", {}, {}, nullptr});
}

void bind_maps(py::module_& module, py::class_<Session, SessionPtr>& session) {
  py::class_<CameraIntrinsics>(
      module, "Camera", "A pinhole camera: z ahead, x right, y down; pixel centres are whole.")
      .def(py::init([](int width_px, int height_px, double fx_px, double fy_px, double cx_px,
                       double cy_px) {
             if (width_px < 1 || height_px < 1 || !(fx_px > 0.0) || !(fy_px > 0.0)) {
               throw py::value_error("a camera's size and focal lengths are to be above 0");
             }
             return CameraIntrinsics{width_px, height_px, fx_px, fy_px, cx_px, cy_px};
           }),
           py::arg("width_px"), py::arg("height_px"), py::arg("fx_px"), py::arg("fy_px"),
           py::arg("cx_px"), py::arg("cy_px"))
      .def_readonly("width_px", &CameraIntrinsics::width_px)
      .def_readonly("height_px", &CameraIntrinsics::height_px)
      .def_readonly("fx_px", &CameraIntrinsics::fx_px)
      .def_readonly("fy_px", &CameraIntrinsics::fy_px)
      .def_readonly("cx_px", &CameraIntrinsics::cx_px)
      .def_readonly("cy_px", &CameraIntrinsics::cy_px);

  py::class_<Frame, std::shared_ptr<Frame>>(module, "Frame",
                                            "One measurement, and where its sensor was.")
      .def(py::init(&make_frame), py::arg("depth_m"), py::arg("camera"), py::arg("T_world_camera"),
           py::arg("stamp_s") = 0.0, py::arg("joint_positions") = std::nullopt,
           "A depth image (height x width, m along the optical axis, 0 or NaN where nothing came "
           "back; copied) of a camera at a pose (4 x 4, its optical frame).")
      .def_readonly("sequence", &Frame::sequence)
      .def_property_readonly("stamp_s", [](const Frame& f) { return f.stamp.seconds(); })
      .def_property_readonly(
          "T_world_camera",
          [](const Frame& f) { return Eigen::Matrix4d(f.T_world_camera.matrix()); })
      .def_property_readonly(
          "camera",
          [](const Frame& f) -> std::optional<CameraIntrinsics> {
            const auto* image = std::get_if<DepthImage>(&f.measurement);
            return image != nullptr ? std::optional(image->camera) : std::nullopt;
          },
          "None of a point cloud.")
      .def_readonly("joint_positions", &Frame::joint_positions, "Or None.")
      .def_property_readonly("depth_m", &depth_of,
                             "height x width, float32: a view that cannot be written; None of a "
                             "point cloud.")
      .def_property_readonly(
          "points_m", &points_of,
          "n x 3, float32, in the sensor's frame: a view that cannot be written; "
          "None of an image.");

  py::class_<Frames, std::shared_ptr<Frames>>(
      module, "Source", "An iterator over frames. Those that cannot be used are passed over.")
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__", &Frames::next)
      .def("__len__",
           [](const Frames& frames) {
             const auto count = frames.source->frame_count();
             if (!count) throw py::type_error("the number of frames is unknown");
             return *count;
           })
      .def_readonly("bad_frames", &Frames::bad_frames,
                    "A sidestep.Error for each frame passed over.");

  py::class_<GridSpec>(module, "Grid",
                       "Cubic voxels; voxel (i, j, k) has its centre at origin_m + (i + 0.5, j + "
                       "0.5, k + 0.5) * resolution_m.")
      .def_readonly("origin_m", &GridSpec::origin_m)
      .def_readonly("resolution_m", &GridSpec::resolution_m)
      .def_property_readonly("size_vox", [](const GridSpec& grid) {
        return std::array{grid.size_vox.x(), grid.size_vox.y(), grid.size_vox.z()};
      });

  py::class_<DistanceField, std::shared_ptr<DistanceField>>(
      module, "DistanceField",
      "The distance to the nearest obstacle, as one snapshot that never changes.")
      .def(
          "distance",
          [](const DistanceField& f, const Doubles& p) { return query(f, p, false).distances_m; },
          py::arg("points_m"), "Of n x 3 points in the world: n, in m.")
      .def(
          "query",
          [](const DistanceField& f, const Doubles& p) {
            FieldQuery all = query(f, p, true);
            return py::make_tuple(all.distances_m, all.gradients, all.statuses);
          },
          py::arg("points_m"),
          "Distances (n, m), gradients (n x 3) and statuses (n: KNOWN, UNKNOWN or OUTSIDE).")
      .def_property_readonly("grid", [](const DistanceField& f) { return f.info().grid; })
      .def_property_readonly(
          "sequence", [](const DistanceField& f) { return f.info().sequence; },
          "Updates that went into it.")
      .def_property_readonly("stamp_s",
                             [](const DistanceField& f) { return f.info().stamp.seconds(); })
      .def_property_readonly(
          "max_distance_m", [](const DistanceField& f) { return f.info().max_distance_m; },
          "Distances are cut off here.")
      .def_property_readonly(
          "block_counts",
          [](const DistanceField& f) {
            const Eigen::Vector3i n = block_counts(dense(f).info().grid);
            return std::array{n.x(), n.y(), n.z()};
          },
          "Blocks of 16 x 16 x 16 voxels along each axis.")
      .def("block", &block, py::arg("i"), py::arg("j"), py::arg("k"),
           "Distances at the centres of a block's voxels: a view that cannot be written and keeps "
           "the field. Fields share the blocks that did not change.")
      .def("distances", &distances,
           "Distances at the centres of all voxels, nx x ny x nz, float32: a copy, of 4 bytes a "
           "voxel.");
  module.attr("KNOWN") = static_cast<int>(FieldStatus::kKnown);
  module.attr("UNKNOWN") = static_cast<int>(FieldStatus::kUnknown);
  module.attr("OUTSIDE") = static_cast<int>(FieldStatus::kOutside);

  py::class_<Map, std::shared_ptr<Map>>(module, "Map", "A mapper and the field made of it.")
      .def(
          "integrate",
          [](Map& map, const Frame& frame) {
            return std::const_pointer_cast<DistanceField>(
                unlocked("map", [&] { return map.integrate(frame); }));
          },
          py::arg("frame"),
          "Adds a frame; the distance field since. Where the frame is unusable (code "
          "\"bad_frame\"), the map is as it was.")
      .def_property_readonly("snapshot", &Map::snapshot,
                             "After the newest frame, with what moves and is tracked as far as "
                             "`motion` says; None before the first. It waits for nothing.")
      .def_property_readonly("grid",
                             [](Map& map) {
                               const py::gil_scoped_release release;
                               const std::scoped_lock lock(map.mutex);
                               return map.mapper->grid();
                             })
      .def(
          "occupied", [](Map& map) { return bits_of(map, &OccupancyView::occupied); },
          "nx x ny x nz, of bool; a copy.")
      .def(
          "known", [](Map& map) { return bits_of(map, &OccupancyView::known); },
          "Observed at least once: nx x ny x nz, of bool; a copy.");

  py::class_<Scene, std::shared_ptr<Scene>>(module, "Scene",
                                            "A world whose shapes are known exactly.")
      .def_property_readonly(
          "objects", [](const Scene& scene) { return names_of(scene.objects()); }, "Names.")
      .def(
          "signed_distance",
          [](const Scene& scene, const Eigen::Vector3d& point_m, double time_s) {
            return scene.signed_distance(point_m, time_s).distance_m;
          },
          py::arg("point_m"), py::arg("time_s") = 0.0, "Exact, in m; below 0 inside an object.")
      .def("field", &scene_field, py::arg("lower_m"), py::arg("upper_m"), py::arg("time_s") = 0.0,
           "Exact distances to the scene as it is at one time, within a box.");

  session
      .def(
          "source",
          [](const SessionPtr& self, const py::object& value, const RobotPtr& robot) {
            const Node node = block_of(value, "source");
            auto source = unlocked("source", [&]() -> Result<std::shared_ptr<Source>> {
              return kept_with(SIDESTEP_TRY(self->host().create<Source>(node, robot)), self, robot);
            });
            return std::make_shared<Frames>(std::move(source));
          },
          py::arg("block"), py::arg("robot") = nullptr,
          "Frames of a camera, recording or simulation.")
      .def("map", &make_map, py::arg("mapper"), py::arg("field"), py::arg("robot") = nullptr,
           py::arg("motion") = "ignored",
           "An empty map of a block `mapper` and a block `field`; with the robot, its own points "
           "can be removed. motion: what moves is \"ignored\"; \"detected\", for "
           "replanner.obstacle_speed_mps; \"tracked\", too; or \"apart\": tracked, and left out "
           "of the field, for a loop with a predictor.")
      .def(
          "scene", &make_scene, py::arg("scene"), py::arg("seed") = std::nullopt,
          "A scene of the installation by its name, a file, or its document as a dict; with a seed "
          "what is random in it is drawn.");
}

}  // namespace sidestep::python
