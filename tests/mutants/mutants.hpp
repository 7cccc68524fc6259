// What mutate.py writes into copies of sources: each function computes what stood there or, where
// SIDESTEP_MUTANT names its mutant, something else; and notes that the mutant was reached.
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <type_traits>

namespace sidestep_mutants {

inline constexpr int kMost = 100000;

/// Which mutants this library or program reached; appended to the file SIDESTEP_REACHED when it
/// ends.
struct Run {
  int active = -1;
  unsigned char reached[kMost] = {};

  Run() {
    if (const char* id = std::getenv("SIDESTEP_MUTANT")) active = std::atoi(id);
  }
  ~Run() {
    const char* path = std::getenv("SIDESTEP_REACHED");
    std::FILE* file = path ? std::fopen(path, "a") : nullptr;
    if (!file) return;
    for (int id = 0; id < kMost; ++id) {
      if (reached[id]) std::fprintf(file, "%d\n", id);
    }
    std::fclose(file);
  }
};
inline Run run;

inline bool on(int id) noexcept {
  run.reached[id] = 1;
  return run.active == id;
}

// Of each two mutants the first is `id`, the second the one after it.
#define SIDESTEP_COMPARISON(name, op, first, second)      \
  template <class A, class B>                             \
  inline bool name(int id, const A& a, const B& b) {      \
    if (on(id)) return static_cast<bool>(a first b);      \
    if (on(id + 1)) return static_cast<bool>(a second b); \
    return static_cast<bool>(a op b);                     \
  }
SIDESTEP_COMPARISON(less, <, <=, >=)
SIDESTEP_COMPARISON(less_equal, <=, <, >)
SIDESTEP_COMPARISON(greater, >, >=, <=)
SIDESTEP_COMPARISON(greater_equal, >=, >, <)
#undef SIDESTEP_COMPARISON

template <class A, class B>
inline bool equal(int id, const A& a, const B& b) {
  return on(id) != static_cast<bool>(a == b);
}
template <class A, class B>
inline bool not_equal(int id, const A& a, const B& b) {
  return on(id) == static_cast<bool>(a == b);
}

#define SIDESTEP_ARITHMETIC(name, op, other)             \
  template <class A, class B>                            \
  inline auto name(int id, A a, B b)->decltype(a op b) { \
    if (on(id)) return a other b;                        \
    return a op b;                                       \
  }
SIDESTEP_ARITHMETIC(plus, +, -)
SIDESTEP_ARITHMETIC(minus, -, +)
SIDESTEP_ARITHMETIC(times, *, /)
SIDESTEP_ARITHMETIC(over, /, *)
#undef SIDESTEP_ARITHMETIC

/// Of Eigen, whose expressions of the two have different types.
template <class A, class B>
inline auto plus_all(int id, const A& a, const B& b)
    -> std::remove_cvref_t<decltype((a + b).eval())> {
  if (on(id)) return a - b;
  return a + b;
}
template <class A, class B>
inline auto minus_all(int id, const A& a, const B& b)
    -> std::remove_cvref_t<decltype((a - b).eval())> {
  if (on(id)) return a + b;
  return a - b;
}

#define SIDESTEP_ASSIGNMENT(name, op, other)    \
  template <class A, class B>                   \
  inline void name(int id, A&& a, const B& b) { \
    if (on(id)) {                               \
      a other b;                                \
    } else {                                    \
      a op b;                                   \
    }                                           \
  }
SIDESTEP_ASSIGNMENT(add, +=, -=)
SIDESTEP_ASSIGNMENT(subtract, -=, +=)
SIDESTEP_ASSIGNMENT(scale, *=, /=)
SIDESTEP_ASSIGNMENT(divide, /=, *=)
#undef SIDESTEP_ASSIGNMENT

template <class A>
inline auto negative(int id, A a) -> decltype(-a) {
  return on(id) ? +a : -a;
}
template <class A>
inline A literal(int id, A value, A other) {
  return on(id) ? other : value;
}

template <int id, class T>
inline T min(const T& a, const T& b) {
  return on(id) ? std::max(a, b) : std::min(a, b);
}
template <int id, class T>
inline T min(std::initializer_list<T> all) {
  return on(id) ? std::max(all) : std::min(all);
}
template <int id, class T>
inline T max(const T& a, const T& b) {
  return on(id) ? std::min(a, b) : std::max(a, b);
}
template <int id, class T>
inline T max(std::initializer_list<T> all) {
  return on(id) ? std::min(all) : std::max(all);
}

}  // namespace sidestep_mutants
