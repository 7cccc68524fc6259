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

/// Depth in m, float32. Whole numbers are some other unit's, and what is all below 0 another
/// axis's.
py::array_t<float, py::array::c_style> depth_in_m(const py::object& given) {
  const py::array numbers = numbers_of(given, "depth_m");
  if (numbers.dtype().kind() != 'f') {
    throw py::type_error("depth_m has to be float32 or float64, in m, and is of type " +
                         std::string(py::str(numbers.dtype())) + ": divide millimetres by 1000");
  }
  const auto depth_m =
      py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(numbers);
  if (!depth_m) throw std::bad_alloc();
  const std::span pixels(depth_m.data(), static_cast<std::size_t>(depth_m.size()));
  if (!pixels.empty() && std::ranges::all_of(pixels, [](float d_m) { return d_m < 0.0F; })) {
    throw py::value_error("depth_m is below 0 everywhere: it counts from the camera ahead");
  }
  return depth_m;
}

Frame make_frame(const py::object& depth, const CameraIntrinsics& camera,
                 const Doubles& T_world_camera, double stamp_s,
                 const std::optional<Doubles>& joint_positions) {
  const auto depth_m = depth_in_m(depth);
  if (depth_m.ndim() != 2 || depth_m.shape(0) != camera.height_px ||
      depth_m.shape(1) != camera.width_px) {
    throw py::value_error("depth_m has to be " + std::to_string(camera.height_px) + " x " +
                          std::to_string(camera.width_px) + ", rows of the camera's image");
  }
  Frame frame;
  frame.stamp = stamp_of(stamp_s, "stamp_s");
  frame.T_world_camera =
      transform_of(matrix_of<Eigen::Matrix4d>(T_world_camera, "T_world_camera"), "T_world_camera");
  frame.measurement =
      DepthImage{camera, std::vector<float>(depth_m.data(), depth_m.data() + depth_m.size())};
  if (joint_positions) {
    if (joint_positions->ndim() != 1) throw py::value_error("joint_positions are one array");
    frame.joint_positions =
        Eigen::Map<const Eigen::VectorXd>(joint_positions->data(), joint_positions->size());
  }
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
        const Unlocked release;
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
  const Unlocked release;
  const std::scoped_lock lock(map.mutex);
  const VoxelBits bits = (view.*which)();
  for (int k = 0; k < size.z(); ++k) {
    for (int j = 0; j < size.y(); ++j) {
      for (int i = 0; i < size.x(); ++i) into(i, j, k) = bits.at(view.occupancy_grid(), {i, j, k});
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

std::shared_ptr<DistanceField> scene_field(const Scene& scene, const Doubles& lower,
                                           const Doubles& upper, double time_s) {
  const auto lower_m = matrix_of<Eigen::Vector3d>(lower, "lower_m");
  const auto upper_m = matrix_of<Eigen::Vector3d>(upper, "upper_m");
  if (!(lower_m.array() < upper_m.array()).all()) {
    throw py::value_error("lower_m has to be below upper_m along each axis");
  }
  return std::make_shared<SceneField>(scene, stamp_of(time_s, "time_s"),
                                      Eigen::AlignedBox3d(lower_m, upper_m));
}

}  // namespace

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
      .def_readonly("width_px", &CameraIntrinsics::width_px, "Columns of its image.")
      .def_readonly("height_px", &CameraIntrinsics::height_px, "Rows of its image.")
      .def_readonly("fx_px", &CameraIntrinsics::fx_px, "Focal length along columns, in pixels.")
      .def_readonly("fy_px", &CameraIntrinsics::fy_px, "Focal length along rows, in pixels.")
      .def_readonly("cx_px", &CameraIntrinsics::cx_px,
                    "Column of the optical axis; that of the first pixel's centre is 0.")
      .def_readonly("cy_px", &CameraIntrinsics::cy_px,
                    "Row of the optical axis; that of the first pixel's centre is 0.");

  py::class_<Frame, std::shared_ptr<Frame>>(module, "Frame",
                                            "One measurement, and where its sensor was.")
      .def(py::init(&make_frame), py::arg("depth_m"), py::arg("camera"), py::arg("T_world_camera"),
           py::arg("stamp_s") = 0.0, py::arg("joint_positions") = std::nullopt,
           "A depth image (height x width, float32 or float64, m along the optical axis, 0 or NaN "
           "where nothing came back; copied) of a camera at a pose (4 x 4, its optical frame).")
      .def_readonly("sequence", &Frame::sequence, "Its number within its source, from 0.")
      .def_property_readonly(
          "stamp_s", [](const Frame& f) { return f.stamp.seconds(); },
          "When it was taken, in s, on its source's clock.")
      .def_property_readonly(
          "T_world_camera",
          [](const Frame& f) { return Eigen::Matrix4d(f.T_world_camera.matrix()); },
          "The sensor's pose, 4 x 4: a camera's optical frame (z ahead, x right, y down).")
      .def_property_readonly(
          "camera",
          [](const Frame& f) -> std::optional<CameraIntrinsics> {
            const auto* image = std::get_if<DepthImage>(&f.measurement);
            return image != nullptr ? std::optional(image->camera) : std::nullopt;
          },
          "The image's Camera; None of a point cloud.")
      .def_readonly("joint_positions", &Frame::joint_positions,
                    "Of the robot at that time, dof values in m or rad; or None.")
      .def_property_readonly(
          "depth_m", &depth_of,
          "height x width, float32, in m: a view that cannot be written; None of a "
          "point cloud.")
      .def_property_readonly(
          "points_m", &points_of,
          "n x 3, float32, in m, in the sensor's frame: a view that cannot be written; "
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
      .def_property_readonly(
          "grid",
          [](Map& map) {
            const Unlocked release;
            const std::scoped_lock lock(map.mutex);
            return map.mapper->grid();
          },
          "The mapper's voxels, world frame.")
      .def(
          "occupied", [](Map& map) { return bits_of(map, &OccupancyView::occupied); },
          "nx x ny x nz, of bool; a copy.")
      .def(
          "known", [](Map& map) { return bits_of(map, &OccupancyView::known); },
          "Observed at least once: nx x ny x nz, of bool; a copy.");

  py::class_<Scene, std::shared_ptr<Scene>>(module, "Scene",
                                            "A world whose shapes are known exactly.")
      .def_property_readonly(
          "objects", [](const Scene& scene) { return names_of(scene.objects()); },
          "Names of its objects.")
      .def(
          "signed_distance",
          [](const Scene& scene, const Doubles& point_m, double time_s) {
            const auto p_m = matrix_of<Eigen::Vector3d>(point_m, "point_m");
            return scene.signed_distance(p_m, time_s).distance_m;
          },
          py::arg("point_m"), py::arg("time_s") = 0.0,
          "Of a point in m, world frame: exact, in m; below 0 inside an object.")
      .def("field", &scene_field, py::arg("lower_m"), py::arg("upper_m"), py::arg("time_s") = 0.0,
           "Exact distances to the scene as it is at one time, in s, within a box between two "
           "corners "
           "in m, world frame.");

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
