// What a page that looks on costs a run: the same run with and without one, in turns.
//
//   viewer_cost [CONFIG [PAIRS [DURATION_S]]]     default: live/floor_pickup 4 12
//
// CONFIG is a closed loop. Prints, for both, the time that mapping a frame and solving took, and
// the steps a second; then the ratios. The page reads all it is sent. In lockstep
// (replan/floor_pickup), both do the same work: then the ratios are medians over frames and solves,
// each held against itself.
#include <fcntl.h>
#include <sqlite3.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "support/temporary_folder.hpp"
#include "unit/viewer/socket_client.hpp"

namespace {

using sidestep::testing_support::SocketClient;
using sidestep::testing_support::TemporaryFolder;

/// What one or more runs measured.
struct Times {
  std::vector<double> mapping_ms;  ///< Integration and field, every frame.
  std::vector<double> solve_ms;    ///< Every search.
  double steps = 0.0, duration_s = 0.0;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// The median of b[i] / a[i] where there are as many, else the ratio of the medians.
double median_ratio(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return quantile(b, 0.5) / quantile(a, 0.5);
  std::vector<double> ratios;
  for (std::size_t i = 0; i < a.size(); ++i) ratios.push_back(b[i] / a[i]);
  return quantile(ratios, 0.5);
}

/// Calls `row` with the statement at every row of an answer.
template <class Row>
void ask(sqlite3* database, const char* question, const Row& row) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database, question, -1, &statement, nullptr) != SQLITE_OK) {
    throw std::runtime_error(sqlite3_errmsg(database));
  }
  while (sqlite3_step(statement) == SQLITE_ROW) row(statement);
  sqlite3_finalize(statement);
}

void read_times(const std::string& file, Times& times) {
  sqlite3* database = nullptr;
  if (sqlite3_open_v2(file.c_str(), &database, SQLITE_OPEN_READONLY, nullptr) != SQLITE_OK) {
    throw std::runtime_error("no results in " + file);
  }
  ask(database, "SELECT rows, float32 FROM arrays WHERE series = 'episode' AND key = 'mapping'",
      [&](sqlite3_stmt* row) {
        const auto* const values = static_cast<const float*>(sqlite3_column_blob(row, 1));
        for (int frame = 0; frame < sqlite3_column_int(row, 0); ++frame) {
          times.mapping_ms.push_back(values[5 * frame + 3] + values[5 * frame + 4]);
        }
      });
  ask(database,
      "SELECT value FROM measurements WHERE series = 'event' AND key = 'solve_ms' AND value > 0",
      [&](sqlite3_stmt* row) { times.solve_ms.push_back(sqlite3_column_double(row, 0)); });
  ask(database, "SELECT key, value FROM measurements WHERE series = 'episode'",
      [&](sqlite3_stmt* row) {
        const char* const key = reinterpret_cast<const char*>(sqlite3_column_text(row, 0));
        if (std::strcmp(key, "steps") == 0) times.steps += sqlite3_column_double(row, 1);
        if (std::strcmp(key, "duration_s") == 0) times.duration_s += sqlite3_column_double(row, 1);
      });
  sqlite3_close(database);
}

pid_t start(std::vector<std::string> arguments) {
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const pid_t process = fork();
  if (process != 0) return process;
  const int nothing = open("/dev/null", O_WRONLY);
  dup2(nothing, STDOUT_FILENO);
  dup2(nothing, STDERR_FILENO);
  execv(argv[0], argv.data());
  _exit(127);
}

unsigned short free_port() {
  const int one = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  bind(one, reinterpret_cast<const sockaddr*>(&address), size);
  getsockname(one, reinterpret_cast<sockaddr*>(&address), &size);
  close(one);
  return ntohs(address.sin_port);
}

/// Connects as soon as the process listens, and reads until it ends. Returns the bytes read.
std::size_t look_on(pid_t process, unsigned short port) {
  while (waitpid(process, nullptr, WNOHANG) == 0) {
    try {
      SocketClient page(port);
      if (page.ask_for_socket() != 101) return 0;
      std::size_t bytes = 0;
      while (const auto message = page.receive_message()) bytes += message->size();
      return bytes;
    } catch (const std::runtime_error&) {
      usleep(10'000);  // It does not listen yet.
    }
  }
  return 0;
}

std::size_t run(const std::string& config, const std::string& duration_s, bool with_page,
                Times& times) {
  const TemporaryFolder folder;
  const unsigned short port = free_port();
  std::vector<std::string> arguments = {SIDESTEP_COMMAND,
                                        "run",
                                        config,
                                        "--out",
                                        folder.path().string(),
                                        "--set",
                                        "experiment.episodes=1",
                                        "--set",
                                        "experiment.duration_s=" + duration_s};
  if (with_page) {
    // --open waits for the page, so that it is there from the beginning.
    arguments.insert(arguments.end(), {"--view", "--open", "--view-port", std::to_string(port)});
  }
  const pid_t process = start(arguments);
  const std::size_t bytes = with_page ? look_on(process, port) : 0;
  waitpid(process, nullptr, 0);
  if (with_page && bytes == 0)
    throw std::runtime_error("no page came; was the viewer's page built?");
  read_times((folder.path() / "results.sqlite").string(), times);
  return bytes;
}

void print(const char* name, const Times& times) {
  std::printf(
      "%-10s mapping %.3f ms (mean), %.3f / %.3f ms (p50 / p95), %zu frames; "
      "solve %.3f ms (p50), %zu; %.1f steps/s\n",
      name, mean(times.mapping_ms), quantile(times.mapping_ms, 0.5),
      quantile(times.mapping_ms, 0.95), times.mapping_ms.size(), quantile(times.solve_ms, 0.5),
      times.solve_ms.size(), times.steps / times.duration_s);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string config = argc > 1 ? argv[1] : "live/floor_pickup";
  const int pairs = argc > 2 ? std::atoi(argv[2]) : 4;
  const std::string duration_s = argc > 3 ? argv[3] : "12";
  setenv("PATH", "/nonexistent", 1);  // No browser is to come.
  Times alone, watched;
  std::size_t bytes = 0;
  try {
    for (int pair = 0; pair < pairs; ++pair) {
      for (const bool with_page : {pair % 2 == 0, pair % 2 != 0}) {
        bytes += run(config, duration_s, with_page, with_page ? watched : alone);
      }
    }
  } catch (const std::exception& exception) {
    std::fprintf(stderr, "viewer_cost: %s\n", exception.what());
    return 1;
  }
  print("alone", alone);
  print("watched", watched);
  std::printf("ratios     mapping %.3f, solve %.3f; %.0f kB/s to the page\n",
              median_ratio(alone.mapping_ms, watched.mapping_ms),
              median_ratio(alone.solve_ms, watched.solve_ms),
              static_cast<double>(bytes) * 1e-3 / watched.duration_s);
  return 0;
}
