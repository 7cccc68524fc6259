#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace sidestep::testing {

/// A record of a bag, taken apart as http://wiki.ros.org/Bags/Format/2.0 says, with nothing of the
/// code under test. Throws where there is none.
struct PlainRecord {
  std::size_t begin = 0, data_begin = 0, end = 0;
  std::map<std::string, std::string> fields;
  std::string data;

  [[nodiscard]] int op() const { return static_cast<unsigned char>(fields.at("op").at(0)); }
  [[nodiscard]] std::uint64_t number(const std::string& name) const {
    return little_endian(fields.at(name));
  }
  static std::uint64_t little_endian(const std::string& bytes) {
    std::uint64_t number = 0;
    for (std::size_t i = bytes.size(); i-- > 0;) {
      number = 256 * number + static_cast<unsigned char>(bytes[i]);
    }
    return number;
  }
};

inline std::map<std::string, std::string> plain_fields(const std::string& header) {
  std::map<std::string, std::string> fields;
  for (std::size_t at = 0; at < header.size();) {
    const std::size_t size = PlainRecord::little_endian(header.substr(at, 4));
    const std::string field = header.substr(at + 4, size);
    fields[field.substr(0, field.find('='))] = field.substr(field.find('=') + 1);
    at += 4 + size;
  }
  return fields;
}

inline PlainRecord plain_record(const std::string& bytes, std::size_t begin) {
  const auto length_at = [&](std::size_t at) {
    if (at + 4 > bytes.size()) throw std::runtime_error("no record");
    return PlainRecord::little_endian(bytes.substr(at, 4));
  };
  PlainRecord record;
  record.begin = begin;
  const std::size_t header = length_at(begin);
  record.fields = plain_fields(bytes.substr(begin + 4, header));
  const std::size_t data = length_at(begin + 4 + header);
  record.data_begin = begin + 8 + header;
  record.end = record.data_begin + data;
  if (record.end > bytes.size()) throw std::runtime_error("a record is cut off");
  record.data = bytes.substr(record.data_begin, data);
  return record;
}

/// All records from one place on to the end.
inline std::vector<PlainRecord> plain_records(const std::string& bytes, std::size_t begin) {
  std::vector<PlainRecord> records;
  for (; begin < bytes.size(); begin = records.back().end) {
    records.push_back(plain_record(bytes, begin));
  }
  return records;
}

inline std::string bytes_of_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace sidestep::testing
