// One library for every plugin that must not load, or must not be created: it is broken in the way
// that the folder it lies in is named after. What breaks at link time are the words below.
#include <dlfcn.h>

#include <cstring>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>

#include <sidestep/plugin/plugin.hpp>

void* function_that_no_library_has();

namespace {

using namespace sidestep;

std::string fault() {
  Dl_info self;
  if (dladdr(reinterpret_cast<const void*>(&fault), &self) == 0) std::abort();
  return std::filesystem::path(self.dli_fname).parent_path().filename().string();
}

struct Options {
  double size_m = 1.0;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("size_m", &Options::size_m, "Not used.", {.unit = "m"});
  }
};

const Schema& schema() {
  static const Schema schema = Options::parameters().schema();
  return schema;
}

const Schema& throwing_schema() { throw std::runtime_error("no schema today"); }

void check(const Node&, std::vector<Error>&) {
  if (fault() == "check_throws") throw std::runtime_error("checked too hard");
}

void* create(const Node&, const HostContext&, Error* error) {
#if defined(UNDEFINED_SYMBOL)
  return function_that_no_library_has();
#endif
  if (fault() == "create_throws") throw std::runtime_error("the sensor is on fire");
  if (fault() == "create_throws_int") throw 42;
  if (fault() == "create_fails") {
    *error = Error{ErrorCode::kPlugin, "no licence for this", "", "buy one", nullptr};
  }
  return nullptr;
}

using Break = void (*)(PluginDescriptor&);

const std::map<std::string, Break>& breaks() {
  static const std::map<std::string, Break> breaks = {
      {"size", [](PluginDescriptor& d) { d.size = 8; }},
      {"magic", [](PluginDescriptor& d) { d.magic = 7; }},
      {"sdk_major", [](PluginDescriptor& d) { d.sdk_major = 99; }},
      {"sdk_minor", [](PluginDescriptor& d) { d.sdk_minor = 99; }},
      {"compiler_abi", [](PluginDescriptor& d) { std::strcpy(d.abi.compiler_abi, "other-1"); }},
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
      {"schema_throws", [](PluginDescriptor& d) { d.schema = &throwing_schema; }}};
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
  d.views = detail::kViewNames<>;
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
  if (fault() == "descriptor_throws") throw 1;
  if (fault() == "null_descriptor") return nullptr;
  static const PluginDescriptor descriptor = make_descriptor();
  return &descriptor;
}
#endif
