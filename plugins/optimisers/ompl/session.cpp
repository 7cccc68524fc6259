#include "session.hpp"

#include <ompl/util/RandomNumbers.h>

namespace sidestep::ompl_optimiser {
namespace {

std::mutex session_mutex;  // guards OMPL's globals, which are the process's, too

}  // namespace

Session::Session(std::uint64_t seed, Log& log)
    : lock_(session_mutex), log_(log), previous_(::ompl::msg::getOutputHandler()) {
  // Seeding a second time works, but OMPL calls it an error: silence it.
  ::ompl::msg::noOutputHandler();
  ::ompl::RNG::setSeed(static_cast<std::uint_fast32_t>(seed % 0x7fffffffu) + 1u);
  ::ompl::msg::useOutputHandler(this);
}

Session::~Session() { ::ompl::msg::useOutputHandler(previous_); }

void Session::log(const std::string& text, ::ompl::msg::LogLevel level, const char*, int) {
  if (level >= ::ompl::msg::LOG_ERROR) {
    log_.error("OMPL: " + text);
  } else if (level == ::ompl::msg::LOG_WARN) {
    log_.warn("OMPL: " + text);
  } else {
    log_.debug("OMPL: " + text);
  }
}

}  // namespace sidestep::ompl_optimiser
