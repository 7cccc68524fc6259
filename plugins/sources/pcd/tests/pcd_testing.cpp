#include "pcd_testing.hpp"

#include <sstream>

namespace sidestep::pcd::testing {

std::string header(std::size_t points, const std::string& encoding, const std::string& fields,
                   const std::string& viewpoint) {
  std::istringstream names(fields);
  std::string sizes, types, counts;
  for (std::string name; names >> name;) {
    sizes += " 4";
    types += " F";
    counts += " 1";
  }
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + fields + "\nSIZE" +
         sizes + "\nTYPE" + types + "\nCOUNT" + counts + "\nWIDTH " + std::to_string(points) +
         "\nHEIGHT 1\nVIEWPOINT " + viewpoint + "\nPOINTS " + std::to_string(points) + "\nDATA " +
         encoding + "\n";
}

std::string ascii_pcd(const Points& points, const std::string& viewpoint) {
  std::ostringstream out;
  out.precision(9);
  out << header(points.size(), "ascii", "x y z", viewpoint);
  for (const Eigen::Vector3f& p : points) out << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
  return out.str();
}

std::string binary_pcd(const Points& points) {
  std::string out = header(points.size(), "binary");
  for (const Eigen::Vector3f& p : points) out += bytes(p.x()) + bytes(p.y()) + bytes(p.z());
  return out;
}

}  // namespace sidestep::pcd::testing
