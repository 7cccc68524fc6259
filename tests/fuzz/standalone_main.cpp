// Runs a target of tests/fuzz without libFuzzer: on a corpus, then on mutations of it that follow
// from their number.
//
//   TARGET [--mutations N] [--seconds S] FILE_OR_FOLDER...
//
// A process of its own does so. Where it ends early, the input that it was at is written to a file.
// An input fails, too, that takes more than a second of the processors', ten under sanitizers, or
// gigabytes of memory.

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>

#include "fuzzing.hpp"

namespace sidestep::fuzzing {
namespace {

namespace fs = std::filesystem;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
constexpr std::size_t kMostBytes = std::size_t{1} << 18;
constexpr int kMostSeconds = kSanitized ? 10 : 1;
constexpr rlim_t kMostMemory_bytes = rlim_t{4} << 30;

/// What the process that runs the target tells the one that waits for it.
struct Progress {
  std::size_t runs;
  std::size_t size;
  std::array<char, kMostBytes> input;
};

class Mutator {
 public:
  explicit Mutator(const std::vector<std::string>& corpus) : corpus_(corpus) {}

  std::string mutated(std::uint32_t number) {
    random_.seed(number);
    std::string input = corpus_[any(corpus_.size())];
    for (std::size_t times = 1 + any(2) * any(4); times > 0; --times) mutate(input);
    if (input.size() > kMostBytes) input.resize(kMostBytes);
    return input;
  }

 private:
  struct Range {
    std::size_t begin, size;
  };

  std::size_t any(std::size_t below) { return below == 0 ? 0 : random_() % below; }
  Range range(const std::string& in, std::size_t most) {
    const std::size_t begin = any(in.size());
    return {begin, any(std::min(most, in.size() - begin) + 1)};
  }
  /// What stands at a random place and consists of such characters.
  template <class IsPart>
  Range run(const std::string& in, const IsPart& is_part) {
    const auto from = in.begin() + static_cast<std::ptrdiff_t>(any(in.size()));
    const auto begin = std::find_if(from, in.end(), is_part);
    const auto end = std::find_if_not(begin, in.end(), is_part);
    return {static_cast<std::size_t>(begin - in.begin()), static_cast<std::size_t>(end - begin)};
  }
  Range word(const std::string& in) {
    return run(in, [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
  }

  void mutate(std::string& input) {
    constexpr std::array<const char*, 16> kNumbers = {
        "0",      "-1",    "1e308",      "-1e308",      "nan",        "inf",
        "1e-320", "1e999", "2147483648", "-2147483649", "4294967296", "9223372036854775807",
        "0x10",   "0.3",   "",           "1000000"};
    // What is text remains well-formed where a number or a word of it is another one.
    const bool is_text = input.find('\0') == std::string::npos;
    switch (is_text && any(2) == 0 ? 5 + any(2) : any(11)) {
      case 0:
        if (!input.empty()) input[any(input.size())] ^= static_cast<char>(1U << any(8));
        break;
      case 1:
        if (!input.empty()) input[any(input.size())] = static_cast<char>(random_());
        break;
      case 2: {
        const Range cut = range(input, 64);
        input.erase(cut.begin, cut.size);
        break;
      }
      case 3: {  // again, somewhere else
        const Range copied = range(input, 256);
        input.insert(any(input.size() + 1), input.substr(copied.begin, copied.size));
        break;
      }
      case 4: {  // of another one
        const std::string& other = corpus_[any(corpus_.size())];
        const Range from = range(other, 1024), to = range(input, 256);
        input.replace(to.begin, to.size, other, from.begin, from.size);
        break;
      }
      case 5: {
        const Range number = run(input, [](unsigned char c) {
          return std::isdigit(c) != 0 || c == '.' || c == '-' || c == 'e';
        });
        if (number.size > 0) {
          input.replace(number.begin, number.size, kNumbers[any(kNumbers.size())]);
        }
        break;
      }
      case 6: {
        const std::string& other = corpus_[any(corpus_.size())];
        const Range from = word(other), to = word(input);
        input.replace(to.begin, to.size, other, from.begin, from.size);
        break;
      }
      case 7: write_number(input); break;
      case 8:
        if (any(4) == 0) input.resize(any(input.size() + 1));
        break;
      case 9: {  // what nests
        if (any(8) != 0) break;
        const Range unit = range(input, 16);
        const std::string repeated = input.substr(unit.begin, unit.size);
        std::string many;
        for (std::size_t times = 1 + any(8000); times > 0; --times) many += repeated;
        input.insert(unit.begin, many);
        break;
      }
      default: std::swap(input[any(input.size())], input[any(input.size())]); break;
    }
  }

  /// Over some bytes, as it lies in memory.
  void write_number(std::string& input) {
    constexpr std::array<std::uint64_t, 9> kWhole = {
        0, 1, ~std::uint64_t{0}, 0x7f, 0xffff, 0x7fffffff, 0x80000000, 0x7fffffffffffffff, 1 << 20};
    std::uint64_t bits = kWhole[any(kWhole.size())];
    const std::size_t size = std::size_t{1} << any(4);
    if (any(3) == 0) {
      const float value = any(2) == 0 ? std::numeric_limits<float>::quiet_NaN()
                                      : std::numeric_limits<float>::infinity();
      bits = size == 8 ? std::bit_cast<std::uint64_t>(double{value})
                       : std::bit_cast<std::uint32_t>(value);
    }
    if (input.size() >= size) std::memcpy(&input[any(input.size() - size + 1)], &bits, size);
  }

  const std::vector<std::string>& corpus_;
  std::minstd_rand random_;
};

void run_one(const std::string& input, Progress& progress) {
  progress.size = std::min(input.size(), kMostBytes);
  std::memcpy(progress.input.data(), input.data(), progress.size);
  const itimerval limit{{0, 0}, {kMostSeconds, 0}};
  setitimer(ITIMER_PROF, &limit, nullptr);  // ends the process
  // In memory of just that size, so that reading past its end is noticed.
  const std::vector<std::uint8_t> bytes(progress.input.data(),
                                        progress.input.data() + progress.size);
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  ++progress.runs;
}

void run_all(const std::vector<std::string>& corpus, std::size_t mutations, double seconds,
             Progress& progress) {
  const int nowhere = open("/dev/null", O_WRONLY);
  dup2(nowhere, STDOUT_FILENO);
  if constexpr (!kSanitized) {
    const rlimit memory{kMostMemory_bytes, kMostMemory_bytes};
    setrlimit(RLIMIT_AS, &memory);
  }
  const auto begin = std::chrono::steady_clock::now();
  for (const std::string& input : corpus) run_one(input, progress);
  Mutator mutator(corpus);
  for (std::uint32_t i = 0; i < mutations; ++i) {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    if (spent.count() > seconds) break;
    run_one(mutator.mutated(i), progress);
  }
}

std::vector<std::string> read_corpus(const std::vector<fs::path>& paths) {
  std::vector<fs::path> files;
  for (const fs::path& path : paths) {
    if (!fs::is_directory(path))
      files.push_back(path);
    else
      for (const auto& entry : fs::recursive_directory_iterator(path)) {
        if (entry.is_regular_file()) files.push_back(entry.path());
      }
  }
  std::ranges::sort(files);
  std::vector<std::string> corpus;
  for (const fs::path& file : files) {
    std::ifstream in(file, std::ios::binary);
    require(in.is_open(), file.string() + " can be read");
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  require(!corpus.empty(), "there is a corpus");
  return corpus;
}

std::string told(int status) {
  if (WIFEXITED(status)) return "it ended with " + std::to_string(WEXITSTATUS(status));
  if (WTERMSIG(status) != SIGPROF) return strsignal(WTERMSIG(status));
  return "it takes longer than " + std::to_string(kMostSeconds) + " s";
}

int run(const std::string& target, const std::vector<fs::path>& paths, std::size_t mutations,
        double seconds) {
  const std::vector<std::string> corpus = read_corpus(paths);
  // Files of inputs are written to memory where that is a folder.
  const fs::path parent = fs::is_directory("/dev/shm") ? "/dev/shm" : fs::temp_directory_path();
  const fs::path folder = parent / ("sidestep_fuzz_" + std::to_string(getpid()));
  fs::create_directory(folder);
  setenv("TMPDIR", folder.c_str(), 1);
  void* const shared =
      mmap(nullptr, sizeof(Progress), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  require(shared != MAP_FAILED, "there is memory");
  auto& progress = *static_cast<Progress*>(shared);
  const pid_t child = fork();
  if (child == 0) {
    run_all(corpus, mutations, seconds, progress);
    std::exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  fs::remove_all(folder);
  std::printf("%s: %zu inputs of a corpus of %zu\n", target.c_str(), progress.runs, corpus.size());
  if (status == 0) return 0;
  const std::string kept = fs::absolute(target + ".input").string();
  std::ofstream(kept, std::ios::binary)
      .write(progress.input.data(), static_cast<std::streamsize>(progress.size));
  std::fprintf(stderr, "%s, at an input of %zu bytes, which is in %s\n", told(status).c_str(),
               progress.size, kept.c_str());
  return 1;
}

}  // namespace
}  // namespace sidestep::fuzzing

int main(int argc, char** argv) {
  std::size_t mutations = 0;
  double seconds = std::numeric_limits<double>::infinity();
  std::vector<std::filesystem::path> paths;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--mutations" && i + 1 < argc) {
      mutations = std::stoul(argv[++i]);
    } else if (argument == "--seconds" && i + 1 < argc) {
      seconds = std::stod(argv[++i]);
    } else {
      paths.emplace_back(argument);
    }
  }
  return sidestep::fuzzing::run(std::filesystem::path(argv[0]).filename().string(), paths,
                                mutations, seconds);
}
