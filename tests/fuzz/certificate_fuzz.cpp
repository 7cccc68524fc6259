// The command is one file that links nothing of Sidestep.
#define main recheck_main
#include "../../tools/recheck/recheck.cpp"
#undef main

#include <sstream>

#include "fuzzing.hpp"

// A certificate is accepted or refused; what refuses it is an exception of the command's own.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    std::istringstream in(sidestep::fuzzing::text_of(data, size));
    Recheck{parse(in)};
  } catch (const std::exception& error) {
    sidestep::fuzzing::require(error.what()[0] != '\0', "a refusal says why");
  }
  return 0;
}
