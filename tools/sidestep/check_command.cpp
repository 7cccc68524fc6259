#include <cstdio>

#include "commands.hpp"

namespace sidestep {

ExitCode check_command(const std::vector<std::string>& configurations,
                       const std::vector<std::string>& overrides) {
  ExitCode code = ExitCode::kSuccess;
  for (const std::string& name : configurations) {
    Console console;
    const CheckedConfiguration loaded = load_configuration(name, overrides, console);
    if (loaded.errors.empty()) {
      std::printf("%s: ok\n", name.c_str());
      continue;
    }
    print_errors(loaded.errors);
    std::printf("%s: %zu error%s\n", name.c_str(), loaded.errors.size(),
                loaded.errors.size() == 1 ? "" : "s");
    code = worse(code, exit_code(loaded.errors));
  }
  return code;
}

}  // namespace sidestep
