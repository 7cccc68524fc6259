#include <cfenv>
#include <filesystem>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing_support::HostFixture;

std::filesystem::path folder(const std::string& name) {
  return std::filesystem::path(ABI_FOLDER) / name;
}

/// Why the library in a folder was refused.
std::string refusal(const std::string& name) {
  HostFixture fixture({folder(name)});
  EXPECT_TRUE(fixture.host.plugins().empty());
  if (fixture.host.rejections().size() != 1) return "not refused";
  const PluginRejection& rejection = fixture.host.rejections().front();
  EXPECT_EQ(rejection.error.code, ErrorCode::kPlugin);
  EXPECT_THAT(rejection.error.where, HasSubstr(name));
  return rejection.error.describe();
}

TEST(Abi, EveryFieldOfTheDescriptorIsChecked) {
  EXPECT_THAT(refusal("magic"), HasSubstr("magic is 7, this host's is"));
  EXPECT_THAT(refusal("size"), HasSubstr("size is 8, this host's is"));
  EXPECT_THAT(refusal("sdk_major"), HasSubstr("built for SDK 99."));
  EXPECT_THAT(refusal("sdk_minor"), HasSubstr("built for SDK 0.99, this host has SDK 0."));
  EXPECT_THAT(refusal("kind"), HasSubstr("kind 77 is not known"));
  EXPECT_THAT(refusal("interface_version"),
              HasSubstr("interface version of kind mapper is 99, this host's is 1"));
  for (const std::string field :
       {"name", "version", "doc", "views", "schema", "check", "create", "destroy"}) {
    EXPECT_THAT(refusal(field), HasSubstr("the descriptor's " + field + " is empty"));
  }
  EXPECT_THAT(refusal("name_empty"), HasSubstr("the descriptor's name is empty"));
}

TEST(Abi, EveryFieldOfTheStampIsCheckedAndBothStampsAreShown) {
  const auto differs = [](const std::string& field, const std::string& theirs) {
    return AllOf(HasSubstr("the ABI stamp differs in " + field), HasSubstr("\n  plugin: "),
                 HasSubstr(theirs), HasSubstr("\n  host:   "), HasSubstr("cmake --build"));
  };
  EXPECT_THAT(refusal("compiler_abi"), differs("compiler ABI", "other-1"));
  EXPECT_THAT(refusal("cxx11_abi"), differs("libstdc++ cxx11 ABI", "cxx11 ABI 0"));
  EXPECT_THAT(refusal("cplusplus"), differs("__cplusplus", "201703"));
  EXPECT_THAT(refusal("eigen_version"), differs("Eigen version", "30399"));
  EXPECT_THAT(refusal("eigen_align"), differs("EIGEN_MAX_ALIGN_BYTES", "EIGEN_MAX_ALIGN_BYTES 32"));
  EXPECT_THAT(refusal("sanitizers"), differs("sanitizers", "memory"));
  EXPECT_THAT(refusal("stamp_without_end"), differs("sanitizers", "xxx"));
}

TEST(Abi, APluginBuiltForAnotherInstructionSetIsRefused) {
  EXPECT_THAT(refusal("march"), AllOf(HasSubstr("EIGEN_MAX_ALIGN_BYTES"), HasSubstr("-march")));
}

TEST(Abi, MacrosThatChangeObjectsAreRefusedByName) {
  EXPECT_THAT(refusal("glibcxx_debug"),
              AllOf(HasSubstr("differs in _GLIBCXX_DEBUG"), HasSubstr("without -D_GLIBCXX_DEBUG")));
  EXPECT_THAT(refusal("eigen_row_major"), HasSubstr("differs in EIGEN_DEFAULT_TO_ROW_MAJOR"));
  EXPECT_THAT(refusal("eigen_index"), HasSubstr("differs in EIGEN_DEFAULT_DENSE_INDEX_TYPE"));
}

TEST(Abi, CompatibleCompilersAndLaterStandardsAreAccepted) {
  for (const std::string name : {"newer_compiler", "cxx23"}) {
    HostFixture fixture({folder(name)});
    EXPECT_EQ(fixture.host.plugins().size(), 1U) << name;
  }
}

/// What is lost where the processor flushes denormals to zero.
double tenth_of_least_normal() {
  volatile double least = std::numeric_limits<double>::min();
  return least / 10.0;
}

TEST(Abi, APluginCannotChangeTheRoundingOfTheHost) {
  ASSERT_GT(tenth_of_least_normal(), 0.0);
  HostFixture fast({folder("fast_math")});
  EXPECT_EQ(fast.host.plugins().size(), 1U);
  EXPECT_GT(tenth_of_least_normal(), 0.0);
  HostFixture rounds({folder("create_rounds")});
  EXPECT_FALSE(rounds.host.create<Mapper>(HostFixture::block("{plugin: broken}")));
  EXPECT_EQ(std::fegetround(), FE_TONEAREST);
}

TEST(Abi, WhatIsNoPluginIsRefused) {
  EXPECT_THAT(refusal("no_symbol"), HasSubstr("does not export sidestep_plugin()"));
  EXPECT_THAT(refusal("null_descriptor"), HasSubstr("returned null"));
  EXPECT_THAT(refusal("undefined_symbol"),
              AllOf(HasSubstr("cannot be loaded: no library has function_that_no_library_has()"),
                    HasSubstr("LINK")));
  EXPECT_THAT(
      refusal("old_symbol"),
      AllOf(HasSubstr("it uses sidestep::function_of_an_old_sidestep(), which this Sidestep "
                      "does not have"),
            HasSubstr("cmake --build")));
  EXPECT_THAT(refusal("descriptor_throws"), HasSubstr("sidestep_plugin() threw"));
  EXPECT_THAT(refusal("schema_throws"), HasSubstr("schema() threw: no schema today"));
  EXPECT_THAT(refusal("not_elf"), HasSubstr("cannot be loaded: "));
  EXPECT_THAT(refusal("empty"), HasSubstr("cannot be loaded: "));
}

TEST(Abi, ALibraryMayHoldSeveralPlugins) {
  HostFixture fixture({folder("pair")});
  ASSERT_EQ(fixture.host.plugins().size(), 2u);
  const auto block = HostFixture::block("{plugin: one_of_two}");
  const auto mapper = fixture.host.create<Mapper>(block);
  ASSERT_FALSE(mapper);
  EXPECT_THAT(mapper.error().describe(), HasSubstr("the mapper of two"));
  const auto cost = fixture.host.create<StateCost>(block);
  ASSERT_FALSE(cost);
  EXPECT_THAT(cost.error().describe(), HasSubstr("the cost of two"));
}

TEST(Abi, EachPluginOfALibraryIsChecked) {
  EXPECT_THAT(refusal("further_magic"), HasSubstr("magic is 7, this host's is"));
  EXPECT_THAT(refusal("further_same"), HasSubstr("holds two plugins that are mapper 'broken'"));
  EXPECT_THAT(refusal("further_without_end"), HasSubstr("holds more than 64 plugins"));
}

std::string creation_error(const std::string& name) {
  HostFixture fixture({folder(name)});
  const auto mapper = fixture.host.create<Mapper>(HostFixture::block("{plugin: broken}"));
  if (mapper) return "created";
  EXPECT_EQ(mapper.error().code, ErrorCode::kPlugin);
  EXPECT_THAT(mapper.error().where, HasSubstr("plugin mapper broken"));
  return mapper.error().describe();
}

TEST(Abi, FailuresOfCreateNameThePlugin) {
  EXPECT_THAT(creation_error("create_throws"), HasSubstr("threw: the sensor is on fire"));
  EXPECT_THAT(creation_error("create_throws_int"), HasSubstr("not a std::exception"));
  EXPECT_THAT(creation_error("create_fails"), HasSubstr("no licence for this (buy one)"));
  EXPECT_THAT(creation_error("create_silent"), HasSubstr("did not say why"));
}

TEST(Abi, AnExceptionOfCheckNamesThePlugin) {
  HostFixture fixture({folder("check_throws")});
  std::vector<Error> errors;
  fixture.host.check(PluginKind::kMapper, HostFixture::block("{plugin: broken}"), errors);
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors[0].code, ErrorCode::kPlugin);
  EXPECT_EQ(errors[0].describe(), "plugin mapper broken: threw: checked too hard");
}

TEST(Abi, OneBrokenLibraryDoesNotHideTheOthers) {
  HostFixture fixture({folder("magic"), folder("create_fails"), folder("no_such_folder")});
  ASSERT_EQ(fixture.host.plugins().size(), 1u);
  EXPECT_EQ(fixture.host.plugins().front().name, "broken");
  EXPECT_EQ(fixture.host.rejections().size(), 1u);
}

TEST(Abi, ThePluginFoundFirstWinsAndTheLogSaysSo) {
  HostFixture fixture({folder("create_throws"), folder("create_fails")});
  ASSERT_EQ(fixture.host.plugins().size(), 1u);
  EXPECT_THAT(fixture.host.plugins().front().library.string(), HasSubstr("create_throws"));
  EXPECT_THAT(fixture.log.messages(),
              testing::Contains(AllOf(HasSubstr("is taken from"), HasSubstr("create_fails"))));
}

TEST(Abi, APluginThatIsNotThereListsWhatIsAndWhereWasLooked) {
  HostFixture fixture({folder("create_fails"), folder("magic"), folder("no_such_folder")});
  const auto mapper = fixture.host.create<Mapper>(HostFixture::block("{plugin: brokem}"));
  ASSERT_FALSE(mapper);
  EXPECT_EQ(mapper.error().code, ErrorCode::kPlugin);
  EXPECT_THAT(mapper.error().describe(),
              AllOf(HasSubstr("test.yaml:1:10: there is no mapper plugin 'brokem'"),
                    HasSubstr("plugins of this kind: broken"), HasSubstr("did you mean 'broken'?"),
                    HasSubstr(folder("no_such_folder").string() + ": No such file"),
                    HasSubstr("magic is 7")));
  const auto field = fixture.host.create<FieldBuilder>(HostFixture::block("{plugin: broken}"));
  ASSERT_FALSE(field);
  EXPECT_THAT(field.error().describe(), HasSubstr("(none found)"));
}

TEST(Abi, ParametersAreCheckedBeforeThePluginSeesThem) {
  HostFixture fixture({folder("create_throws")});
  const auto mapper =
      fixture.host.create<Mapper>(HostFixture::block("{plugin: broken, size_n: 3}"));
  ASSERT_FALSE(mapper);
  EXPECT_EQ(mapper.error().code, ErrorCode::kConfig);
  EXPECT_THAT(mapper.error().describe(), HasSubstr("did you mean 'size_m'?"));
}

}  // namespace
}  // namespace sidestep
