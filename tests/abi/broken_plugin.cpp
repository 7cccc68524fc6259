// One source for every plugin that must not load: BREAK is the statement that breaks `d`, or one of
// the words below.
#include <cstring>
#include <stdexcept>

#include <sidestep/plugin/plugin.hpp>

void* function_that_no_library_has();

namespace {

using namespace sidestep;

struct Options {
  double size_m = 1.0;
  static Fields<Options> fields() {
    return Fields<Options>().add("size_m", &Options::size_m, "Not used.", {.unit = "m"});
  }
};

const Schema& schema() {
  static const Schema schema = Options::fields().schema();
  return schema;
}

[[maybe_unused]] const Schema& throwing_schema() { throw std::runtime_error("no schema today"); }

void check(const Node&, std::vector<Error>&) {
#if defined(CHECK_THROWS)
  throw std::runtime_error("checked too hard");
#endif
}

void* create(const Node&, const HostContext&, [[maybe_unused]] Error* error) {
#if defined(UNDEFINED_SYMBOL)
  return function_that_no_library_has();
#elif defined(CREATE_THROWS)
  throw std::runtime_error("the sensor is on fire");
#elif defined(CREATE_THROWS_INT)
  throw 42;
#elif defined(CREATE_FAILS)
  *error = Error{ErrorCode::kPlugin, "no licence for this", "", "buy one", nullptr};
  return nullptr;
#else
  return nullptr;
#endif
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
#if defined(BREAK)
  BREAK;
#endif
  return d;
}

}  // namespace

#if defined(NO_SYMBOL)
extern "C" SIDESTEP_EXPORT int something_else() { return 1; }
#elif defined(NULL_DESCRIPTOR)
extern "C" SIDESTEP_EXPORT const PluginDescriptor* sidestep_plugin() { return nullptr; }
#elif defined(DESCRIPTOR_THROWS)
extern "C" SIDESTEP_EXPORT const PluginDescriptor* sidestep_plugin() { throw 1; }
#else
extern "C" SIDESTEP_EXPORT const PluginDescriptor* sidestep_plugin() {
  static const PluginDescriptor descriptor = make_descriptor();
  return &descriptor;
}
#endif
