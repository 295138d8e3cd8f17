"""CCSDS navigation messages (OEM, AEM) and ephemeris tables, in and out."""
