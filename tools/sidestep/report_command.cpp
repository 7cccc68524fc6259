#include <cstdio>

#include <sidestep/experiments/report.hpp>

#include "commands.hpp"

namespace sidestep {

ExitCode report_command(const std::vector<std::filesystem::path>& runs,
                        const std::filesystem::path& comparison) {
  ExitCode code = ExitCode::kSuccess;
  const auto refuse = [&](const Error& error) {
    print_errors({error});
    const bool users = error.code == ErrorCode::kNotFound;
    code = worse(code, users ? ExitCode::kConfiguration : exit_code(error));
  };
  for (const std::filesystem::path& run : runs) {
    if (const auto written = write_report(run); !written) {
      refuse(written.error());
    } else {
      std::printf("%s\n", (run / "report.html").c_str());
    }
  }
  if (code != ExitCode::kSuccess || runs.size() < 2) return code;
  const auto table = compare_runs(runs, comparison);
  if (!table) {
    refuse(table.error());
    return code;
  }
  std::printf("%s\n\n%s", comparison.c_str(), table->c_str());
  return code;
}

}  // namespace sidestep
