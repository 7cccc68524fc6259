#include <cstdio>

#include <sidestep/experiments/experiments.hpp>

#include "commands.hpp"

namespace sidestep {

ExitCode report_command(const std::vector<std::filesystem::path>& runs,
                        const std::filesystem::path& comparison,
                        const std::filesystem::path& merged) {
  ExitCode code = ExitCode::kSuccess;
  Console console;
  Session session(RunSettings{.threads = 1}, &console);
  Host& host = session.host();
  const auto refuse = [&](const Error& error) {
    print_errors({error});
    const bool users = error.code == ErrorCode::kNotFound || error.code == ErrorCode::kConfig;
    code = worse(code, users ? ExitCode::kConfiguration : exit_code(error));
  };
  for (const std::filesystem::path& run : runs) {
    if (const auto written = write_report(run, host); !written) {
      refuse(written.error());
    } else {
      std::printf("%s\n", (run / "report.html").c_str());
    }
  }
  if (code != ExitCode::kSuccess || runs.size() < 2) return code;
  if (are_shards(runs)) {
    const auto whole = merge_shards(runs, merged, host);
    if (!whole) {
      refuse(whole.error());
      return code;
    }
    std::printf("%s\n\n%s\n%s\n", (merged / "report.html").c_str(), whole->table.c_str(),
                whole->verdict.c_str());
    return whole->success ? code : worse(code, ExitCode::kTaskFailed);
  }
  const auto table = compare_runs(runs, comparison, host);
  if (!table) {
    refuse(table.error());
    return code;
  }
  std::printf("%s\n\n%s", comparison.c_str(), table->c_str());
  return code;
}

}  // namespace sidestep
