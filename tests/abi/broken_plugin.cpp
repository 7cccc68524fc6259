// One library for every plugin that must not load, or must not be created: it is broken in the way
// that the folder it lies in is named after, or does harm to the process that opens it. What breaks
// at link time are the words below.
#include <dlfcn.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cfenv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

void* function_that_no_library_has();
namespace sidestep {
void* function_of_an_old_sidestep();
}

namespace {

using namespace sidestep;

std::string fault() {
  Dl_info self;
  if (dladdr(reinterpret_cast<const void*>(&fault), &self) == 0) std::abort();
  return std::filesystem::path(self.dli_fname).parent_path().filename().string();
}

void lower_limit() {
  const rlimit none{4, 4};
  setrlimit(RLIMIT_NOFILE, &none);
}

void block_signals() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, nullptr);
}

/// What libraries do as they are opened, or asked, whose name says `STAGE_HARM`.
void harm_process(const std::string& stage) {
  const std::string name = fault();
  if (!name.starts_with(stage + "_harm_")) return;
  const std::string how = name.substr(stage.size() + 6);
  if (how == "segv") *static_cast<volatile int*>(nullptr) = 1;
  if (how == "abort") std::abort();
  if (how == "exit") std::exit(0);
  if (how == "quick_exit") std::quick_exit(0);
  if (how == "throw") throw std::runtime_error("not today");
  if (how == "kill") std::raise(SIGKILL);
  if (how == "alarm") alarm(1);
  if (how == "fork") (void)!fork();
  if (how == "limit") lower_limit();
  if (how == "close") close_range(0, 1000, 0);
  if (how == "signal") kill(getppid(), SIGTERM);
  if (how == "mask") block_signals();
  if (how == "late_abort" || how == "late_exit") {
    std::thread([how] {
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      how == "late_abort" ? std::abort() : std::exit(0);
    }).detach();
  }
  if (how == "hang") {
    for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
  }
}

struct Construct {
  Construct() { harm_process("construct"); }
  ~Construct() { harm_process("destruct"); }
};
const Construct construct;

struct Options {
  double size_m = 1.0;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("size_m", &Options::size_m, "Not used.", {.unit = "m"});
  }
};

const Schema& schema() {
  harm_process("schema");
  static const Schema schema = Options::parameters().schema();
  return schema;
}

const Schema& throwing_schema() { throw std::runtime_error("no schema today"); }

void check(const Node&, std::vector<Error>&) {
  harm_process("check");
  if (fault() == "check_throws") throw std::runtime_error("checked too hard");
}

void* create(const Node&, const HostContext&, Error* error) {
#if defined(UNDEFINED_SYMBOL)
  return UNDEFINED_SYMBOL();
#endif
  harm_process("create");
  if (fault() == "create_rounds") std::fesetround(FE_TOWARDZERO);
  if (fault() == "create_throws") throw std::runtime_error("the sensor is on fire");
  if (fault() == "create_throws_int") throw 42;
  if (fault() == "create_fails") {
    *error = Error{ErrorCode::kPlugin, "no licence for this", "", "buy one", nullptr};
  }
  return nullptr;
}

using Break = void (*)(PluginDescriptor&);

/// Another plugin of the library.
PluginDescriptor& further(const PluginDescriptor& first, const char* name) {
  static PluginDescriptor other;
  other = first;
  other.name = name;
  return other;
}

const std::map<std::string, Break>& breaks() {
  static const std::map<std::string, Break> breaks = {
      {"size", [](PluginDescriptor& d) { d.size = 8; }},
      {"magic", [](PluginDescriptor& d) { d.magic = 7; }},
      {"sdk_major", [](PluginDescriptor& d) { d.sdk_major = 99; }},
      {"sdk_minor", [](PluginDescriptor& d) { d.sdk_minor = 99; }},
      {"compiler_abi", [](PluginDescriptor& d) { std::strcpy(d.abi.compiler_abi, "other-1"); }},
      {"newer_compiler",
       [](PluginDescriptor& d) { std::strcpy(d.abi.compiler_abi, "itanium-1021"); }},
      {"cxx11_abi", [](PluginDescriptor& d) { d.abi.libstdcxx_cxx11_abi = 0; }},
      {"cplusplus", [](PluginDescriptor& d) { d.abi.cplusplus = 201703; }},
      {"eigen_version", [](PluginDescriptor& d) { d.abi.eigen_version = 30399; }},
      {"eigen_align", [](PluginDescriptor& d) { d.abi.eigen_max_align_bytes = 32; }},
      {"sanitizers", [](PluginDescriptor& d) { std::strcpy(d.abi.sanitizers, "memory"); }},
      {"stamp_without_end",
       [](PluginDescriptor& d) { std::memset(d.abi.sanitizers, 'x', sizeof(d.abi.sanitizers)); }},
      {"kind", [](PluginDescriptor& d) { d.kind = static_cast<PluginKind>(77); }},
      {"interface_version", [](PluginDescriptor& d) { d.interface_version = 99; }},
      {"name", [](PluginDescriptor& d) { d.name = nullptr; }},
      {"version", [](PluginDescriptor& d) { d.version = nullptr; }},
      {"doc", [](PluginDescriptor& d) { d.doc = nullptr; }},
      {"views", [](PluginDescriptor& d) { d.views = nullptr; }},
      {"schema", [](PluginDescriptor& d) { d.schema = nullptr; }},
      {"check", [](PluginDescriptor& d) { d.check = nullptr; }},
      {"create", [](PluginDescriptor& d) { d.create = nullptr; }},
      {"destroy", [](PluginDescriptor& d) { d.destroy = nullptr; }},
      {"name_empty", [](PluginDescriptor& d) { d.name = ""; }},
      {"schema_throws", [](PluginDescriptor& d) { d.schema = &throwing_schema; }},
      {"further_magic",
       [](PluginDescriptor& d) {
         PluginDescriptor& other = further(d, "another");
         other.magic = 7;
         d.next = &other;
       }},
      {"further_same", [](PluginDescriptor& d) { d.next = &further(d, d.name); }},
      {"further_without_end", [](PluginDescriptor& d) {
         static std::deque<std::string> names;
         static std::deque<PluginDescriptor> chain;
         for (int i = 0; i <= kMostPluginsOfLibrary; ++i) {
           chain.push_back(d);
           chain.back().name = names.emplace_back("broken_" + std::to_string(i)).c_str();
           chain.back().next = std::exchange(d.next, &chain.back());
         }
       }}};
  return breaks;
}

PluginDescriptor make_descriptor() {
  PluginDescriptor d{};
  d.size = sizeof(PluginDescriptor);
  d.magic = kPluginMagic;
  d.sdk_major = kSdkMajor;
  d.sdk_minor = kSdkMinor;
  d.interface_version = kMapperInterface;
  d.abi = abi_stamp();
  d.kind = PluginKind::kMapper;
  d.name = "broken";
  d.version = "1";
  d.doc = "Broken on purpose";
  d.views = detail::kViewNames<OccupancyView>;
  d.schema = &schema;
  d.check = &check;
  d.create = &create;
  d.destroy = [](void*) {};
  if (const auto found = breaks().find(fault()); found != breaks().end()) found->second(d);
  return d;
}

}  // namespace

#if defined(NO_SYMBOL)
extern "C" SIDESTEP_EXPORT int something_else() { return 1; }
#else
extern "C" SIDESTEP_EXPORT const PluginDescriptor* sidestep_plugin() {
  harm_process("descriptor");
  if (fault() == "descriptor_throws") throw 1;
  if (fault() == "null_descriptor") return nullptr;
  static const PluginDescriptor descriptor = make_descriptor();
  return &descriptor;
}
#endif
