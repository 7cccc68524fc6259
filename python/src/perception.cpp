// What loops see, and the predictors and gazes that Python classes are.
#include <cmath>
#include <stdexcept>

#include <sidestep/runtime/predict.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

using FieldPtr = std::shared_ptr<DistanceField>;
using RowsOf4 = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;

Track make_track(std::int64_t id, const Doubles& position_m, const Doubles& velocity_mps,
                 double radius_m, double top_m, double last_seen_s, double bottom_m,
                 const std::optional<Doubles>& covariance, double first_seen_s) {
  return {.id = id,
          .position_m = matrix_of<Eigen::Vector2d>(position_m, "position_m"),
          .velocity_mps = matrix_of<Eigen::Vector2d>(velocity_mps, "velocity_mps"),
          .covariance = covariance ? matrix_of<Eigen::Matrix4d>(*covariance, "covariance")
                                   : Eigen::Matrix4d::Zero(),
          .radius_m = radius_m,
          .bottom_m = bottom_m,
          .top_m = top_m,
          .first_seen = stamp_of(first_seen_s, "first_seen_s"),
          .last_seen = stamp_of(last_seen_s, "last_seen_s")};
}

PredictedSet make_set(const Track& track, const Doubles& times_s, const Doubles& centres_m,
                      const Doubles& radii_m, double likelihood) {
  const auto n = times_s.size();
  if (times_s.ndim() != 1 || radii_m.ndim() != 1 || radii_m.size() != n || centres_m.ndim() != 2 ||
      centres_m.shape(0) != n || centres_m.shape(1) != 2) {
    throw py::value_error("times_s, centres_m and radii_m have to be n, n x 2 and n, and are " +
                          shape_text(times_s) + ", " + shape_text(centres_m) + " and " +
                          shape_text(radii_m));
  }
  PredictedSet set{track.id, likelihood, track.bottom_m, track.top_m, {}};
  for (py::ssize_t k = 0; k < n; ++k) {
    set.knots.push_back({times_s.at(k), {centres_m.at(k, 0), centres_m.at(k, 1)}, radii_m.at(k)});
  }
  return set;
}

SnapshotPtr make_snapshot(const FieldPtr& field, std::optional<std::vector<Track>> tracks) {
  auto snapshot = std::make_shared<Snapshot>(Snapshot{{.field = field}});
  if (!tracks) return snapshot;
  std::ranges::sort(*tracks, {}, &Track::id);
  snapshot->map.tracks =
      std::make_shared<const Tracks>(Tracks{std::move(*tracks), field->info().stamp});
  need(check_tracks(*snapshot->map.tracks));
  return snapshot;
}

std::optional<std::vector<Track>> tracks_of(const Snapshot& snapshot) {
  if (!snapshot.map.tracks) return std::nullopt;
  return snapshot.map.tracks->tracks;
}

/// What a predictor in Python is asked: copies, which it may keep.
struct Asked {
  Tracks tracks;
  double horizon_s = 0.0;
  std::shared_ptr<const DistanceField> field;
  std::optional<RobotFootprint> robot;
};

/// A predictor that a Python class is: a subclass of sidestep.Predictor.
class PythonPredictor final : public Predictor {
 public:
  static constexpr const char* kClass = "Predictor";

  PythonPredictor(const py::object& self, const SnapshotSlot& slot, Fault& fault)
      : self_(self), name_(name_of(self, "predictor")), slot_(slot), fault_(fault) {
    const std::string of = py::str(self.attr("subject"));
    if (of == "things") subject_ = PredictionSubject::kThings;
    if (of == "nothing") subject_ = PredictionSubject::kNothing;
    if (of != "tracks" && subject_ == PredictionSubject::kTracks) {
      throw py::value_error("subject has to be \"tracks\", \"things\" or \"nothing\"");
    }
  }

  PredictionSubject subject() const noexcept override { return subject_; }

  Result<Prediction> predict(const PredictionRequest& request) override {
    return noted(fault_, name_, [&]() -> Result<Prediction> {
      const auto kept = [](Error error) {
        error.message = "predict(): " + error.message;
        return tl::make_unexpected(std::move(error));
      };
      auto prediction = Prediction::create(request.tracks.stamp, sets_of(request));
      if (!prediction) return kept(prediction.error());
      const auto checked = check_prediction(*prediction, request, subject_);
      if (!checked) return kept(checked.error());
      return prediction;
    });
  }

 private:
  std::vector<PredictedSet> sets_of(const PredictionRequest& request) const {
    Asked asked{request.tracks, request.horizon_s, slot_.pin(), {}};
    if (asked.field.get() != request.field) asked.field = nullptr;
    if (request.robot != nullptr) asked.robot = *request.robot;
    const Locked lock;
    const auto wrong = [](const py::handle& value) {
      return py::type_error("predict() has to return PredictedSets, and returns " +
                            std::string(py::str(py::type::handle_of(value).attr("__name__"))));
    };
    const py::object said = called(self_.get(), "predict", std::move(asked));
    if (!py::isinstance<py::iterable>(said)) throw wrong(said);
    std::vector<PredictedSet> sets;
    for (const py::handle item : said) {
      if (!py::isinstance<PredictedSet>(item)) throw wrong(item);
      sets.push_back(item.cast<PredictedSet>());
    }
    return sets;
  }

  Held self_;
  std::string name_;
  PredictionSubject subject_ = PredictionSubject::kTracks;
  const SnapshotSlot& slot_;
  Fault& fault_;
};

/// What a gaze in Python is asked, while it is.
struct Looking {
  const GazeRequest* request;  ///< Null afterwards.
  SnapshotPtr seen;            ///< Null before the first map.

  [[nodiscard]] const GazeRequest& now() const {
    if (request == nullptr) throw std::runtime_error("a GazeRequest is over when look() returns");
    return *request;
  }
};

/// A gaze that a Python class is: a subclass of sidestep.Gaze.
class PythonGaze final : public Gaze {
 public:
  static constexpr const char* kClass = "Gaze";

  PythonGaze(const py::object& self, const SnapshotSlot& slot, Fault& fault)
      : self_(self),
        name_(name_of(self, "gaze")),
        wants_tracks_(self.attr("wants_tracks").cast<bool>()),
        slot_(slot),
        fault_(fault) {}

  bool wants_tracks() const noexcept override { return wants_tracks_; }

  Result<HeadAngles> look(const GazeRequest& request) override {
    return noted(fault_, name_, [&]() -> Result<HeadAngles> {
      const Locked lock;
      const auto looking = std::make_shared<Looking>(Looking{&request, nullptr});
      if (request.field != nullptr) {
        looking->seen = std::make_shared<Snapshot>(Snapshot{slot_.snapshot()});
      }
      struct End {
        Looking& looking;
        ~End() { looking.request = nullptr; }
      } const end{*looking};
      return angles_of(called(self_.get(), "look", looking), "look");
    });
  }

 private:
  Held self_;
  std::string name_;
  bool wants_tracks_;
  const SnapshotSlot& slot_;
  Fault& fault_;
};

py::tuple pair_of(const HeadAngles& angles) {
  return py::make_tuple(angles.pan_rad, angles.tilt_rad);
}

void bind_tracks(py::module_& module) {
  py::class_<Track>(module, "Track",
                    "A thing that moves, or has moved and stands, as a vertical cylinder in the "
                    "world.")
      .def(py::init(&make_track), py::arg("id"), py::arg("position_m"), py::arg("velocity_mps"),
           py::arg("radius_m"), py::arg("top_m"), py::arg("last_seen_s"), py::arg("bottom_m") = 0.0,
           py::arg("covariance") = std::nullopt, py::arg("first_seen_s") = 0.0,
           "Of a tracker of yours. position_m, velocity_mps: x and y. covariance: 4 x 4, of x, y "
           "(m) and their velocities (m/s); None: exact.")
      .def_readonly("id", &Track::id, "The thing's own for as long as it is tracked.")
      .def_readonly("position_m", &Track::position_m, "Of its axis: x and y in m, world frame.")
      .def_readonly("velocity_mps", &Track::velocity_mps, "Of its axis: x and y, in m/s.")
      .def_readonly("covariance", &Track::covariance,
                    "4 x 4, of x, y, and their velocities, in m and m/s.")
      .def_readonly("radius_m", &Track::radius_m, "Of the cylinder, in m.")
      .def_readonly("bottom_m", &Track::bottom_m, "Height of its lower end, in m.")
      .def_readonly("top_m", &Track::top_m, "Height of its upper end, in m.")
      .def_property_readonly(
          "first_seen_s", [](const Track& t) { return t.first_seen.seconds(); },
          "When it was seen first, in s, on the maps' clock.")
      .def_property_readonly(
          "last_seen_s", [](const Track& t) { return t.last_seen.seconds(); },
          "When it was seen last, in s: before its map's stamp while it is out of sight.");

  py::class_<Snapshot, SnapshotPtr>(module, "Snapshot", "A map as loops see it; never changes.")
      .def(py::init(&make_snapshot), py::arg("field").none(false), py::arg("tracks") = std::nullopt,
           "tracks: of a tracker of yours, at the field's stamp. For a loop with a predictor, the "
           "field is one without what is tracked.")
      .def_property_readonly(
          "field",
          [](const Snapshot& s) { return std::const_pointer_cast<DistanceField>(s.map.field); },
          "The map's distance field; without what is tracked where motion=\"apart\".")
      .def_property_readonly("tracks", &tracks_of,
                             "A list of Track, by id; None where nobody tracks.")
      .def_property_readonly(
          "moving",
          [](const Snapshot& s) -> std::optional<RowsOf4> {
            if (!s.map.moving) return std::nullopt;
            RowsOf4 rows(std::ssize(s.map.moving->balls), 4);
            Eigen::Index i = 0;
            for (const MovingBall& ball : s.map.moving->balls) {
              rows.row(i++) << ball.centre_m.transpose(), ball.radius_m;
            }
            return rows;
          },
          "Balls where something moves, n x 4: centres and radii in m, world frame; None where "
          "nobody looks for it.")
      .def_property_readonly(
          "T_world_camera",
          [](const Snapshot& s) -> std::optional<Eigen::Matrix4d> {
            if (!s.map.camera) return std::nullopt;
            return s.map.camera->T_world_camera.matrix();
          },
          "Of the newest image, 4 x 4, optical frame; None where there is none.");
  py::implicitly_convertible<DistanceField, Snapshot>();

  py::class_<PredictedSet>(module, "PredictedSet",
                           "Where a track may be: anywhere in a vertical cylinder whose centre and "
                           "radius change linearly from knot to knot.")
      .def(
          py::init(&make_set), py::arg("track"), py::arg("times_s"), py::arg("centres_m"),
          py::arg("radii_m"), py::arg("likelihood") = 1.0,
          "times_s: n, ascending, after the tracks' stamp. centres_m: n x 2, world frame. radii_m: "
          "n. likelihood: above 0; sets of one track are alternatives, and sum to 1 at most.")
      .def_readonly("track", &PredictedSet::track, "The track's id.")
      .def_readonly("likelihood", &PredictedSet::likelihood,
                    "Above 0, at most 1; those of one track's sets sum to 1 at most.")
      .def_readonly("bottom_m", &PredictedSet::bottom_m, "Height of its lower end, in m.")
      .def_readonly("top_m", &PredictedSet::top_m, "Height of its upper end, in m.")
      .def_property_readonly(
          "knots",
          [](const PredictedSet& set) {
            RowsOf4 rows(std::ssize(set.knots), 4);
            Eigen::Index i = 0;
            for (const PredictedSet::Knot& knot : set.knots) {
              rows.row(i++) << knot.time_s, knot.centre_m.transpose(), knot.radius_m;
            }
            return rows;
          },
          "n x 4: time in s from the tracks' stamp, x, y and radius in m, world frame.");
}

void bind_requests(py::module_& module) {
  py::class_<Asked>(module, "PredictionRequest", "What a predictor is asked.")
      .def_property_readonly(
          "stamp_s", [](const Asked& asked) { return asked.tracks.stamp.seconds(); },
          "Of the tracks, in s: time 0 of the sets.")
      .def_property_readonly(
          "tracks", [](const Asked& asked) { return asked.tracks.tracks; },
          "A list of Track: whom sets are wanted of.")
      .def_readonly("horizon_s", &Asked::horizon_s, "Sets are wanted from 0 up to here, in s.")
      .def_property_readonly(
          "field",
          [](const Asked& asked) { return std::const_pointer_cast<DistanceField>(asked.field); },
          "The map without what is tracked, or None.")
      .def_property_readonly(
          "robot",
          [](const Asked& asked) -> py::object {
            if (!asked.robot) return py::none();
            return py::make_tuple(asked.robot->position_m, asked.robot->velocity_mps,
                                  asked.robot->radius_m);
          },
          "A disc around it on the floor: position (x, y in m), velocity (m/s) and radius (m); "
          "None where it is not known.");

  py::class_<Looking, std::shared_ptr<Looking>>(module, "GazeRequest",
                                                "What a gaze is asked; over when look() returns.")
      .def_property_readonly(
          "now_s", [](const Looking& l) { return l.now().now.seconds(); }, "The loop's time, in s.")
      .def_property_readonly(
          "q", [](const Looking& l) { return l.now().state.q; },
          "Measured positions, dof values in m or rad.")
      .def_property_readonly(
          "qdot", [](const Looking& l) { return l.now().state.qdot; },
          "Measured velocities, dof values in m/s or rad/s.")
      .def_property_readonly(
          "at", [](const Looking& l) { return pair_of(l.now().at); },
          "Where the head is: pan and tilt in rad.")
      .def_property_readonly(
          "rest", [](const Looking& l) { return pair_of(l.now().head.rest()); },
          "Where plans have it: pan and tilt in rad.")
      .def_property_readonly(
          "way",
          [](const Looking& l) -> std::optional<Trajectory> {
            if (l.now().way == nullptr) return std::nullopt;
            return *l.now().way;
          },
          "The way to the goal that was found last, or None.")
      .def_property_readonly(
          "way_from_s", [](const Looking& l) { return l.now().way_from_s; },
          "The time of `way` at which the robot is on it, in s.")
      .def_property_readonly(
          "way_blocked_s", [](const Looking& l) { return l.now().way_blocked_s; },
          "The time of `way` from which it is blocked, in s, or None.")
      .def_readonly("snapshot", &Looking::seen, "The newest map; None before the first.")
      .def(
          "may",
          [](const Looking& l, double pan_rad, double tilt_rad) {
            return l.now().may({pan_rad, tilt_rad});
          },
          py::arg("pan_rad"), py::arg("tilt_rad"),
          "Whether the head keeps apart from the robot and from obstacles if it turns there.")
      .def(
          "towards",
          [](const Looking& l, const Doubles& point_m) {
            const GazeRequest& request = l.now();
            return pair_of(request.head.towards(matrix_of<Eigen::Vector3d>(point_m, "point_m"),
                                                request.T_world_link, request.at));
          },
          py::arg("point_m"),
          "Pan and tilt in rad with which the camera looks at a point of the world, or as near to "
          "it as it gets.")
      .def(
          "T_world_camera",
          [](const Looking& l, double pan_rad, double tilt_rad) -> Eigen::Matrix4d {
            const GazeRequest& request = l.now();
            return request.head.T_world_camera({pan_rad, tilt_rad}, request.T_world_link).matrix();
          },
          py::arg("pan_rad"), py::arg("tilt_rad"),
          "Its camera's pose there, 4 x 4, optical frame, as the robot stands.");
}

}  // namespace

HeadAngles angles_of(const py::object& value, const char* method) {
  const std::string what = std::string(method) + "() has to return pan and tilt, two numbers";
  Doubles angles;
  try {
    angles = doubles_of(value, method);
  } catch (const py::type_error&) {
    throw py::type_error(what + ", and returns none");
  }
  if (angles.ndim() != 1 || angles.size() != 2) {
    throw py::value_error(what + ", and returns " + shape_text(angles));
  }
  if (!std::isfinite(angles.at(0)) || !std::isfinite(angles.at(1))) {
    throw py::value_error(what + ", and returns what is not finite");
  }
  return {angles.at(0), angles.at(1)};
}

PluginPtr<Predictor> make_predictor(const SessionPtr& session, const RobotPtr& robot,
                                    const py::object& value, const SnapshotSlot& slot,
                                    Fault& fault) {
  return part_of<Predictor, PythonPredictor>(session, robot, value, "predictor", "predictor",
                                             "predict", slot, fault);
}

PluginPtr<Gaze> make_gaze(const SessionPtr& session, const RobotPtr& robot, const py::object& value,
                          const SnapshotSlot& slot, Fault& fault) {
  return part_of<Gaze, PythonGaze>(session, robot, value, "gaze", "gaze", "look", slot, fault);
}

void bind_perception(py::module_& module) {
  bind_tracks(module);
  bind_requests(module);
}

}  // namespace sidestep::python
