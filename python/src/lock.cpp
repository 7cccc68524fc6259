#include "lock.hpp"

namespace sidestep::python {

namespace {

/// Of the frames of a call, from the innermost on, the first in the file that has the method: not
/// the one in which threading.py waits for that.
py::object own_frame(const OpenCall& call, const py::object& innermost) {
  const py::object method = call.self.attr(call.method);
  if (!py::hasattr(method, "__code__")) return innermost;
  const py::object file = method.attr("__code__").attr("co_filename");
  for (py::object frame = innermost; !frame.is_none(); frame = frame.attr("f_back")) {
    if (file.equal(frame.attr("f_code").attr("co_filename"))) return frame;
  }
  return innermost;
}

}  // namespace

void warn_of_open_calls(const std::string& what) {
  const Locked lock;
  const std::list<OpenCall> calls = open_calls;  // which end, and begin, while Python is asked
  const py::object logger = py::module_::import("logging").attr("getLogger")("sidestep");
  const py::dict frames = py::module_::import("sys").attr("_current_frames")();
  for (const OpenCall& call : calls) {
    const py::int_ thread(call.thread);
    if (!frames.contains(thread)) continue;
    const py::object frame = own_frame(call, frames[thread]), code = frame.attr("f_code");
    logger.attr("warning")("%s in %s.%s(): %s:%d, in %s", what,
                           py::type::of(call.self).attr("__name__"), call.method,
                           code.attr("co_filename"), frame.attr("f_lineno"), code.attr("co_name"));
  }
}

}  // namespace sidestep::python
