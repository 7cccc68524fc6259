#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/field/dense_field.hpp>
#include <sidestep/planning/gaze.hpp>
#include <sidestep/planning/prediction.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/session.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>

#include "lock.hpp"

/// What the parts of the Python module share. Interfaces of the SDK are bound as they are; what
/// blocks and configurations are in C++ are dicts here.

namespace sidestep::python {

/// Numbers as rows of doubles. As an argument it takes what doubles_of() takes.
using DoubleRows = py::array_t<double, py::array::c_style | py::array::forcecast>;
struct Doubles : DoubleRows {
  using DoubleRows::DoubleRows;
  Doubles(DoubleRows rows) : DoubleRows(std::move(rows)) {}  // NOLINT(google-explicit-constructor)
};

/// An error as the exception sidestep.Error.
[[nodiscard]] py::object exception_of(const Error& error);
[[noreturn]] void raise(const Error& error);

/// The value, or raises.
template <class T>
T need(Result<T>&& result) {
  if (!result) raise(result.error());
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

/// Calls what returns a Result without Python's lock; raises where it fails. What escapes names the
/// plugin it came from, or else `what`.
template <class Call>
auto unlocked(const std::string& what, Call&& call) {
  auto result = [&] {
    const Unlocked release;
    return catch_all(what, std::forward<Call>(call));
  }();
  return need(std::move(result));
}

/// A dict, list, number, string, path, bool or None, or an array of numpy, as a node whose marks
/// are its keys, e.g. "mapper.size_vox". Raises TypeError for anything else.
[[nodiscard]] Node node_of(const py::handle& value, const std::string& mark);
/// The other way round: scalars as YAML reads them.
[[nodiscard]] py::object object_of(const Node& node);

/// The block of a plugin: a dict, or the name of a plugin without parameters.
[[nodiscard]] Node block_of(const py::handle& value, const std::string& kind);

/// A block of settings, with the defaults of what it leaves out; None: all defaults.
template <class Settings>
[[nodiscard]] Settings settings_of(const py::object& value, const std::string& mark) {
  Settings settings;
  if (value.is_none()) return settings;
  const Node node = node_of(value, mark);
  const auto parameters = Settings::parameters();
  std::vector<Error> errors;
  check_against_schema(node, parameters.schema(), {}, errors);
  if (errors.empty()) parameters.read(node, settings, errors);
  if (!errors.empty()) raise(errors.front());
  return settings;
}

/// A configuration of a robot: the name of a pose, `{"pose": ..., "joints": {...}}`, or dof values.
[[nodiscard]] Eigen::VectorXd configuration_of(const py::object& value,
                                               const RobotDescription& robot,
                                               const std::string& mark);

/// E.g. "3 x 1 x 7".
[[nodiscard]] std::string shape_text(std::span<const py::ssize_t> shape);
[[nodiscard]] inline std::string shape_text(const Doubles& array) {
  return shape_text({array.shape(), static_cast<std::size_t>(array.ndim())});
}

/// Raises TypeError, naming `what`, for anything but whole or real numbers: truth values, complex
/// numbers and objects are none.
[[nodiscard]] py::array numbers_of(const py::handle& value, const std::string& what);
[[nodiscard]] Doubles doubles_of(const py::handle& value, const std::string& what);
/// Raises ValueError, naming `what`, unless the array has that shape.
template <class Matrix>
[[nodiscard]] Matrix matrix_of(const Doubles& array, const char* what) {
  constexpr py::ssize_t kRows = Matrix::RowsAtCompileTime, kColumns = Matrix::ColsAtCompileTime;
  Matrix matrix;
  if (kColumns == 1 ? array.ndim() != 1 || array.size() != kRows
                    : array.ndim() != 2 || array.shape(0) != kRows || array.shape(1) != kColumns) {
    throw py::value_error(std::string(what) + " has to be " + std::to_string(kRows) +
                          (kColumns == 1 ? "" : " x " + std::to_string(kColumns)) +
                          " numbers, and is " + shape_text(array));
  }
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    matrix(i / kColumns, i % kColumns) = array.data()[i];
  }
  return matrix;
}
/// A time as a stamp; raises ValueError, naming `what`, for what is none.
[[nodiscard]] Stamp stamp_of(double time_s, const char* what);
/// Raises ValueError, naming `what`, unless the array has `columns` columns; its rows.
[[nodiscard]] py::ssize_t rows_of(const Doubles& array, py::ssize_t columns, const char* what);

/// The voxels of a field; raises where it has none.
[[nodiscard]] const DenseField& dense(const DistanceField& field);

/// A read-only view of memory that `owner` keeps.
template <class T>
[[nodiscard]] py::array view_of(std::vector<py::ssize_t> shape, const T* data,
                                const py::object& owner) {
  py::array array(py::dtype::of<T>(), std::move(shape), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// A plugin's object, which keeps alive what it was made by.
template <class Interface, class... Kept>
[[nodiscard]] std::shared_ptr<Interface> kept_with(PluginPtr<Interface> object, Kept... kept) {
  struct Holder {
    std::tuple<Kept...> kept;
    PluginPtr<Interface> object;  // goes first
  };
  auto holder = std::make_shared<Holder>(Holder{{std::move(kept)...}, std::move(object)});
  return std::shared_ptr<Interface>(holder, holder->object.get());
}

/// The kind of a Python object and its class, e.g. "cost Wrist".
[[nodiscard]] inline std::string name_of(const py::object& self, const char* kind) {
  return std::string(kind) + " " + std::string(py::str(py::type::of(self).attr("__name__")));
}

/// Raises TypeError for anything but an object of a class derived from sidestep.`of`, or of one
/// that has what that has.
void need_object(const py::object& value, const char* of,
                 std::initializer_list<const char*> members);

/// An object of a Python class, as the host hands out a plugin's, and named after its class.
template <class Interface, class Adapter, class... More>
[[nodiscard]] PluginPtr<Interface> made_of(const py::object& self, const char* kind,
                                           More&&... more) {
  return {new Adapter(self, std::forward<More>(more)...),
          {[](void* object) { delete static_cast<Interface*>(object); }, name_of(self, kind)}};
}

/// The first that went wrong in what Python does for a loop; whoever steps that raises it.
using Fault = std::optional<Error>;

/// Calls into Python as into a plugin, and keeps what goes wrong.
template <class Call>
[[nodiscard]] auto noted(Fault& fault, const std::string& name, Call&& call) {
  auto result = call_stage(name, std::forward<Call>(call));
  if (!result && !fault) fault = result.error();
  return result;
}

/// Has one thread at a time in what calls Python. To be entered without Python's lock.
class Alone {
 public:
  /// Fails within a method of Python's where somebody is in already, since he may wait for that.
  [[nodiscard]] Result<std::unique_lock<std::mutex>> enter(const char* refusal) {
    std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() && python_depth > 0) return fail(ErrorCode::kInvalidArgument, refusal);
    if (!lock.owns_lock()) lock.lock();
    return lock;
  }

 private:
  std::mutex mutex_;
};

using SessionPtr = std::shared_ptr<Session>;
using RobotPtr = std::shared_ptr<const RobotModel>;

/// A map as loops see it.
struct Snapshot {
  MapSnapshot map;
  bool is_apart = false;  ///< What is tracked has been left out of its field.
};
using SnapshotPtr = std::shared_ptr<Snapshot>;

/// A block, or an object of a Python class with that method; null of None. `key`: of the block.
template <class Interface, class Adapter, class... More>
[[nodiscard]] PluginPtr<Interface> part_of(const SessionPtr& session, const RobotPtr& robot,
                                           const py::object& value, const char* key,
                                           const char* kind, const char* method, More&&... more) {
  if (value.is_none()) return nullptr;
  if (!py::isinstance<py::str>(value) && !py::isinstance<py::dict>(value)) {
    need_object(value, Adapter::kClass, {method});
    return made_of<Interface, Adapter>(value, kind, std::forward<More>(more)...);
  }
  const Node node = block_of(value, key);
  return unlocked(key, [&] { return session->host().create<Interface>(node, robot); });
}
[[nodiscard]] PluginPtr<Optimiser> make_optimiser(const SessionPtr& session, const RobotPtr& robot,
                                                  const py::object& value, const char* key);
/// `slot` has the map that the loop is in; it and `fault` outlive the object, as of the next.
[[nodiscard]] PluginPtr<Predictor> make_predictor(const SessionPtr& session, const RobotPtr& robot,
                                                  const py::object& value, const SnapshotSlot& slot,
                                                  Fault& fault);
[[nodiscard]] PluginPtr<Gaze> make_gaze(const SessionPtr& session, const RobotPtr& robot,
                                        const py::object& value, const SnapshotSlot& slot,
                                        Fault& fault);
/// Pan and tilt of what a method of a Python object's returned; raises where they are none.
[[nodiscard]] HeadAngles angles_of(const py::object& value, const char* method);
/// Settings for a robot: where nothing else is said, it stands on the floor, what nobody has seen
/// is occupied, and what is outside of the map is as what is unknown.
[[nodiscard]] PlanningSettings planning_of(const py::object& value, const RobotModel& robot);

void bind_robots(py::module_& module, py::class_<Session, SessionPtr>& session);
void bind_maps(py::module_& module, py::class_<Session, SessionPtr>& session);
void bind_fields(py::module_& module);
void bind_perception(py::module_& module);
void bind_planning(py::module_& module, py::class_<Session, SessionPtr>& session);
void bind_loops(py::module_& module, py::class_<Session, SessionPtr>& session);

}  // namespace sidestep::python

template <>
struct pybind11::detail::type_caster<sidestep::python::Doubles> {
  PYBIND11_TYPE_CASTER(sidestep::python::Doubles,
                       handle_type_name<sidestep::python::DoubleRows>::name);

  bool load(handle from, bool /*convert*/) {
    value = sidestep::python::doubles_of(from, "what is given");
    return true;
  }
};
