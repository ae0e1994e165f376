// A participant of Fast DDS that finds others on this machine's loopback interface, without multicast.
#pragma once

#include <memory>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

using namespace eprosima::fastdds::dds;

inline DomainParticipant* join(int domain) {
    namespace rtps = eprosima::fastrtps::rtps;
    DomainParticipantQos qos;
    qos.name("fast_dds_peer");
    qos.transport().use_builtin_transports = false;  // no shared memory: others have none
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().user_transports.push_back(udp);
    for (int index = 0; index < 20; ++index) {
        rtps::Locator_t place;
        rtps::IPLocator::setIPv4(place, 127, 0, 0, 1);
        place.port = 7400 + 250 * domain + 10 + 2 * index;  // DDSI-RTPS 2.3, 9.6.1.1
        qos.wire_protocol().builtin.initialPeersList.push_back(place);
    }
    qos.wire_protocol().builtin.discovery_config.leaseDuration_announcementperiod = {0, 500000000};
    return DomainParticipantFactory::get_instance()->create_participant(domain, qos);
}

template <class Qos> Qos quality(Qos qos, bool is_reliable, bool is_latched, int depth) {
    qos.reliability().kind = is_reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = is_latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = depth;
    qos.endpoint().history_memory_policy =
        eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;  // as rmw_fastrtps
    return qos;
}
