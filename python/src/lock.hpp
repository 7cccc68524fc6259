#pragma once

#include <cxxabi.h>
#include <unistd.h>

#include <list>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <pybind11/pybind11.h>

#include <sidestep/core/time.hpp>

/// Python's lock, and methods of Python's objects.
///
/// Once the interpreter ends, what takes its lock ends the thread instead: pthread_exit() unwinds
/// C++, too, and where that may not throw, or catches everything, the process aborts. Here such a
/// thread rests until the process is gone, as all do from Python 3.14 on.

namespace sidestep::python {

namespace py = pybind11;

[[nodiscard]] inline bool is_ending() {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsFinalizing() != 0;
#else
  return _Py_IsFinalizing() != 0;
#endif
}

/// Calls what may end the thread because the interpreter ends.
template <class Call>
auto or_rest(Call&& call) {
  try {
    return call();
  } catch (abi::__forced_unwind&) {
    for (;;) ::pause();
  }
}

/// Without Python's lock for as long as it lives.
class Unlocked {
 public:
  Unlocked() : state_(PyEval_SaveThread()) {}
  ~Unlocked() {
    or_rest([this] { PyEval_RestoreThread(state_); });
  }
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;

 private:
  PyThreadState* state_;
};

/// With Python's lock for as long as it lives; throws where the interpreter ends.
class Locked {
 public:
  Locked() {
    if (is_ending() && PyGILState_Check() == 0) throw std::runtime_error("Python ends");
    or_rest([this] { lock_.emplace(); });
  }

 private:
  std::optional<py::gil_scoped_acquire> lock_;
};

/// An object of Python's, let go of with Python's lock, whoever does so.
class Held {
 public:
  explicit Held(py::object object) : object_(std::move(object)) {}
  ~Held() {
    if (is_ending() && PyGILState_Check() == 0) {
      object_.release();
      return;
    }
    const Locked lock;
    object_.release().dec_ref();
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;

  [[nodiscard]] const py::object& get() const noexcept { return object_; }

 private:
  py::object object_;
};

/// How many methods of Python's this thread is in.
inline thread_local int python_depth = 0;

/// A method of a Python object's that a thread is in.
struct OpenCall {
  unsigned long thread;
  py::object self;
  const char* method;
};
inline std::list<OpenCall> open_calls;  ///< Kept under Python's lock.

/// Warns, by Python's logging, of every open call: in which class, function and line it is. Takes
/// Python's lock.
void warn_of_open_calls(const std::string& what);

/// A method of a Python object's, called with Python's lock. An interrupt goes on to whoever called
/// into the module, too.
template <class... Arguments>
py::object called(const py::object& self, const char* method, Arguments&&... arguments) {
  struct Within {
    Within(const py::object& of, const char* name)
        : call(open_calls.insert(open_calls.end(),
                                 OpenCall{PyThread_get_thread_ident(), of, name})) {
      ++python_depth;
    }
    ~Within() {
      --python_depth;
      open_calls.erase(call);
    }
    std::list<OpenCall>::iterator call;
  } const within(self, method);
  try {
    const py::object function = self.attr(method);
    const py::tuple given = py::make_tuple(std::forward<Arguments>(arguments)...);
    PyObject* const result =
        or_rest([&] { return PyObject_CallObject(function.ptr(), given.ptr()); });
    if (result == nullptr) throw py::error_already_set();
    return py::reinterpret_steal<py::object>(result);
  } catch (const py::error_already_set& error) {
    (void)error.what();  // kept, since to put it into words would use up the interrupt
    if (error.matches(PyExc_KeyboardInterrupt)) PyErr_SetInterrupt();
    throw;
  }
}

}  // namespace sidestep::python
