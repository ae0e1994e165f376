// Messages of ROS 2 for Fast DDS, as its rmw_fastrtps has them: fields written one after the other by Fast CDR.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/dds/topic/TopicDataType.hpp>

using eprosima::fastcdr::Cdr;

struct Header {
    int32_t sec = 0;
    uint32_t nanosec = 0;
    std::string frame_id;
    template <class F> void each(F& field) { field(sec), field(nanosec), field(frame_id); }
};

struct JointState {
    static constexpr const char* type = "sensor_msgs::msg::dds_::JointState_";
    Header header;
    std::vector<std::string> name;
    std::vector<double> position, velocity, effort;
    template <class F> void each(F& field) {
        header.each(field), field(name), field(position), field(velocity), field(effort);
    }
};

struct OperatingState {
    static constexpr const char* type = "crtk_msgs::msg::dds_::OperatingState_";
    Header header;
    std::string state;
    bool is_homed = false, is_busy = false;
    template <class F> void each(F& field) { header.each(field), field(state), field(is_homed), field(is_busy); }
};

struct StringStamped {
    static constexpr const char* type = "crtk_msgs::msg::dds_::StringStamped_";
    Header header;
    std::string string;
    template <class F> void each(F& field) { header.each(field), field(string); }
};

struct PoseStamped {
    static constexpr const char* type = "geometry_msgs::msg::dds_::PoseStamped_";
    Header header;
    double position[3] = {0, 0, 0}, orientation[4] = {0, 0, 0, 1};
    template <class F> void each(F& field) {
        header.each(field);
        for (double& number : position) field(number);
        for (double& number : orientation) field(number);
    }
};

// What rmw_fastrtps registers with Fast DDS for a message: no key, CDR of version 1 with its four bytes in front.
template <class Message> class MessageType : public eprosima::fastdds::dds::TopicDataType {
    struct Writing {
        Cdr& cdr;
        template <class T> void operator()(const T& value) { cdr << value; }
    };
    struct Reading {
        Cdr& cdr;
        template <class T> void operator()(T& value) { cdr >> value; }
    };

  public:
    using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
    MessageType() {
        setName(Message::type);
        m_typeSize = 1 << 16;
        m_isGetKeyDefined = false;
        auto_fill_type_object(false);
        auto_fill_type_information(false);
    }
    bool serialize(void* data, Payload* payload) override {
        eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        payload->encapsulation = CDR_LE;
        cdr.serialize_encapsulation();
        Writing writing{cdr};
        static_cast<Message*>(data)->each(writing);
        payload->length = static_cast<uint32_t>(cdr.getSerializedDataLength());
        return true;
    }
    bool deserialize(Payload* payload, void* data) override {
        try {
            eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
            Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
            cdr.read_encapsulation();
            Reading reading{cdr};
            static_cast<Message*>(data)->each(reading);
            return true;
        } catch (const eprosima::fastcdr::exception::Exception&) {
            return false;
        }
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override {
        return [this] { return m_typeSize; };
    }
    void* createData() override { return new Message; }
    void deleteData(void* data) override { delete static_cast<Message*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

// The bytes of any message, as they come.
struct Bytes {
    std::vector<uint8_t> data;
};

class BytesType : public eprosima::fastdds::dds::TopicDataType {
  public:
    using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
    explicit BytesType(const std::string& name) {
        setName(name.c_str());
        m_typeSize = 1 << 16;
        m_isGetKeyDefined = false;
        auto_fill_type_object(false);
        auto_fill_type_information(false);
    }
    bool serialize(void* data, Payload* payload) override {
        const auto& bytes = static_cast<Bytes*>(data)->data;
        if (bytes.size() > payload->max_size) return false;
        std::copy(bytes.begin(), bytes.end(), payload->data);
        payload->length = static_cast<uint32_t>(bytes.size());
        payload->encapsulation = CDR_LE;
        return true;
    }
    bool deserialize(Payload* payload, void* data) override {
        static_cast<Bytes*>(data)->data.assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override {
        return [this] { return m_typeSize; };
    }
    void* createData() override { return new Bytes; }
    void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};
