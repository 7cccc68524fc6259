// The Python module sidestep._core: errors, blocks and sessions; the rest is bound by its
// neighbours.
#include <string_view>

#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/library_version.hpp>
#include <sidestep/runtime/planning_settings.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

/// sidestep.Error; lives as long as the interpreter.
py::handle error_type;

Node scalar(std::string text, bool quoted, const std::string& mark) {
  return Node(Node::Scalar{std::move(text), quoted}, SourceMark{mark, 0, 0});
}

std::string float_text(const py::handle& value) {
  const double number = value.cast<double>();
  if (std::isnan(number)) return ".nan";
  if (std::isinf(number)) return number > 0.0 ? ".inf" : "-.inf";
  return py::repr(value);
}

/// Makes nodes, within the limits that files have (runtime/yaml_document.cpp): a list may hold
/// itself.
class Nodes {
 public:
  Node of(const py::handle& value, const std::string& mark) {
    constexpr int kMaxDepth = 100, kMaxNodes = 1'000'000;
    if (depth_ >= kMaxDepth) {
      throw py::value_error(beginning(mark) + ": nested too deeply, in more than " +
                            std::to_string(kMaxDepth) + " levels");
    }
    if (++nodes_ > kMaxNodes) {
      throw py::value_error(beginning(mark) + ": too large, of more than " +
                            std::to_string(kMaxNodes) + " values");
    }
    ++depth_;
    Node node = made_of(value, mark);
    --depth_;
    return node;
  }

 private:
  static std::string beginning(const std::string& mark) {
    constexpr std::size_t kShown = 60;
    return mark.size() <= kShown ? mark : mark.substr(0, kShown) + "...";
  }

  Node made_of(const py::handle& value, const std::string& mark) {
    if (value.is_none()) {
      Node nothing;
      nothing.set_mark({mark, 0, 0});
      return nothing;
    }
    if (py::isinstance<py::bool_>(value)) {
      return scalar(value.cast<bool>() ? "true" : "false", false, mark);
    }
    if (py::isinstance<py::int_>(value)) return scalar(py::str(value), false, mark);
    if (py::isinstance<py::float_>(value)) return scalar(float_text(value), false, mark);
    if (py::isinstance<py::str>(value)) return scalar(py::str(value), true, mark);
    if (py::hasattr(value, "__fspath__")) {
      return scalar(py::str(value.attr("__fspath__")()), true, mark);
    }
    if (py::isinstance<py::dict>(value)) return map_of(value, mark);
    if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
      Node::List list;
      for (const auto& item : value) {
        list.push_back(of(item, mark + "[" + std::to_string(list.size()) + "]"));
      }
      return Node(std::move(list), {mark, 0, 0});
    }
    if (py::hasattr(value, "tolist")) return of(value.attr("tolist")(), mark);  // numpy's
    throw py::type_error(mark + ": " + std::string(py::str(py::type::of(value))) +
                         " cannot be part of a block");
  }

  Node map_of(const py::handle& value, const std::string& mark) {
    const std::string prefix = mark.empty() ? "" : mark + ".";
    Node::Map map;
    for (const auto& [key, item] : py::reinterpret_borrow<py::dict>(value)) {
      const std::string name = py::str(key);
      Node::Entry& entry = map.emplace_back();
      entry.key = name;
      entry.key_mark.file = mark;
      entry.value = of(item, prefix + name);
    }
    return Node(std::move(map), {mark, 0, 0});
  }

  int depth_ = 0;
  int nodes_ = 0;
};

SessionPtr make_session(std::uint64_t seed, int threads,
                        std::vector<std::filesystem::path> plugin_paths) {
  if (threads < 0) throw py::value_error("threads is to be 0, for one per core, or more");
  const Unlocked release;
  return std::make_shared<Session>(RunSettings{seed, threads, std::move(plugin_paths)});
}

py::object read(const Session& session, const std::filesystem::path& file,
                const std::vector<std::string>& overrides) {
  auto reading = [&] {
    const Unlocked release;
    return read_configuration(file, overrides, session.documents());
  }();
  if (!reading.errors.empty()) raise(reading.errors.front());
  return object_of(reading.configuration.root);
}

}  // namespace

py::object exception_of(const Error& error) {
  py::object exception = py::reinterpret_borrow<py::object>(error_type)(error.describe());
  exception.attr("code") = std::string(to_string(error.code));
  exception.attr("message") = error.message;
  exception.attr("where") = error.where;
  exception.attr("hint") = error.hint;
  return exception;
}

void raise(const Error& error) {
  PyErr_SetObject(error_type.ptr(), exception_of(error).ptr());
  throw py::error_already_set();
}

Node node_of(const py::handle& value, const std::string& mark) { return Nodes().of(value, mark); }

py::object object_of(const Node& node) {
  if (node.is_map()) {
    py::dict map;
    for (const Node::Entry& entry : node.entries())
      map[py::str(entry.key)] = object_of(entry.value);
    return map;
  }
  if (node.is_list()) {
    py::list list;
    for (const Node& item : node.items()) list.append(object_of(item));
    return list;
  }
  if (node.is_null()) return py::none();
  if (const auto value = node.as_bool()) return py::bool_(*value);
  if (const auto value = node.as_int()) return py::int_(*value);
  if (const auto value = node.as_double()) return py::float_(*value);
  return py::str(node.text());
}

Node block_of(const py::handle& value, const std::string& kind) {
  if (!py::isinstance<py::str>(value)) return node_of(value, kind);
  py::dict block;
  block["plugin"] = value;
  return node_of(block, kind);
}

Eigen::VectorXd configuration_of(const py::object& value, const RobotDescription& robot,
                                 const std::string& mark) {
  if (py::isinstance<py::str>(value) || py::isinstance<py::dict>(value)) {
    py::dict block;
    if (py::isinstance<py::str>(value)) block["pose"] = value;
    const Node node = node_of(py::isinstance<py::str>(value) ? py::object(block) : value, mark);
    std::vector<Error> errors;
    check_against_schema(node, RobotStateEntry::parameters().schema(), {}, errors);
    Eigen::VectorXd q;
    if (errors.empty()) q = read_robot_state(node, robot, errors);
    if (!errors.empty()) raise(errors.front());
    return q;
  }
  const Doubles array = doubles_of(value, mark);
  if (array.ndim() != 1 || array.shape(0) != robot.dof()) {
    throw py::value_error(mark + " has to have " + std::to_string(robot.dof()) +
                          " values, one for " + "each joint of '" + robot.name + "'");
  }
  return Eigen::Map<const Eigen::VectorXd>(array.data(), robot.dof());
}

py::array numbers_of(const py::handle& value, const std::string& what) {
  auto array = py::array::ensure(value);
  if (!array) throw py::type_error(what + " has to be numbers");
  const char kind = array.dtype().kind();
  if (kind == 'f' || kind == 'i' || kind == 'u') return array;
  throw py::type_error(what + " has to be numbers, and is of type " +
                       std::string(py::str(array.dtype())));
}

Doubles doubles_of(const py::handle& value, const std::string& what) {
  if (DoubleRows::check_(value)) return py::reinterpret_borrow<DoubleRows>(value);
  const auto array = DoubleRows::ensure(numbers_of(value, what));
  if (!array) throw std::bad_alloc();
  return array;
}

Stamp stamp_of(double time_s, const char* what) {
  constexpr double kLargest_s = 9e9;
  if (std::abs(time_s) < kLargest_s) return Stamp::from_seconds(time_s);
  throw py::value_error(std::string(what) + " has to be a time in s, up to 285 years");
}

void need_object(const py::object& value, const char* of,
                 std::initializer_list<const char*> members) {
  const std::string wanted = std::string("an object of a class derived from sidestep.") + of;
  if (PyType_Check(value.ptr()) != 0) {
    const std::string name = py::str(value.attr("__name__"));
    throw py::type_error("the class " + name + " stands where " + wanted + " is wanted: " + name +
                         "(...)");
  }
  for (const char* const member : members) {
    if (py::hasattr(value, member)) continue;
    throw py::type_error(std::string(py::str(py::type::of(value).attr("__name__"))) +
                         " stands where " + wanted + " is wanted: it has no `" + member + "`");
  }
}

std::string shape_text(std::span<const py::ssize_t> shape) {
  std::string text;
  for (const py::ssize_t size : shape) text += (text.empty() ? "" : " x ") + std::to_string(size);
  return text.empty() ? "one number" : text;
}

py::ssize_t rows_of(const Doubles& array, py::ssize_t columns, const char* what) {
  if (array.ndim() == 2 && array.shape(1) == columns) return array.shape(0);
  throw py::value_error(std::string(what) + " have to be an array of n x " +
                        std::to_string(columns));
}

PYBIND11_MODULE(_core, module) {
  // What follows hands over objects whose layout both have to agree about.
  constexpr std::string_view kBuiltFor = SIDESTEP_MODULE_VERSION;
  if (kBuiltFor != library_version()) {
    throw py::import_error("the module sidestep is of version " + std::string(kBuiltFor) +
                           ", the library that it has loaded of " + library_version() +
                           ": install both of one version");
  }
  module.attr("__version__") = library_version();
  module.doc() = "Maps, distance fields, robots and motion planning (sidestep).";
  error_type = PyErr_NewExceptionWithDoc("sidestep.Error",
                                         "What Sidestep cannot do, in words: `code` (\"config\", "
                                         "\"bad_frame\", ...), `message`, `where` "
                                         "(file:line:col, key, frame or plugin) and `hint`.",
                                         PyExc_RuntimeError, nullptr);
  module.add_object("Error", error_type);

  py::class_<Session, SessionPtr> session(
      module, "Session",
      "The installation's plugins, robots and scenes, and the threads that are lent to them.\n\n"
      "Blocks are dicts with the keys of a configuration, e.g. {\"plugin\": \"edt\"}; of a plugin "
      "without parameters the name will do.");
  session
      .def(py::init(&make_session), py::arg("seed") = 0, py::arg("threads") = 0,
           py::arg("plugin_paths") = std::vector<std::filesystem::path>(),
           "threads: 0 for one per core. plugin_paths: folders that are searched first.")
      .def("configuration", &read, py::arg("file"),
           py::arg("overrides") = std::vector<std::string>(),
           "A configuration file, with the files that it builds on, as a dict; overrides: "
           "\"a.b=value\". Blocks are checked where they are used.");
  bind_robots(module, session);
  bind_fields(module);
  bind_maps(module, session);
  bind_perception(module);
  bind_planning(module, session);
  bind_loops(module, session);
}

}  // namespace sidestep::python
